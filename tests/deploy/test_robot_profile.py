"""The compose file's profile `robot`: twin, agent and training by their own commands, no containers."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from bus_setup import wait_until
from compose_file import ROOT, services, settings
from ray_cluster import free_port
from role_redis import RoleRedis, role_redis

from taskschema.bus.records import RunRecords
from taskschema_learner.run_folder import RunFolder

CONTROL_PORT = 9190
"""The twin's, in its own network."""
PATIENCE_SECONDS = 240.0
"""For what takes seconds on an idle machine."""
PROFILE = ("robot-twin", "robot-learner", "robot")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[RoleRedis]:
    (tmp_path / "redis").mkdir()
    with role_redis(tmp_path / "redis") as running:
        yield running


class Profile:
    """Runs services as processes: their ports are free ones, and their volumes lie in a folder."""

    def __init__(self, stack: ExitStack, server: RoleRedis, folder: Path) -> None:
        self._stack, self._server, self._folder = stack, server, folder
        self._port = free_port()

    def command(self, service: str) -> list[str]:
        """Return a service's command, in this test's places."""
        words: list[str] = services()[service]["command"]
        replaced = {
            f"--control {CONTROL_PORT}": f"--control {self._port} --left 0 --right 0",
            f":{CONTROL_PORT}": f":{self._port}",
            "/episodes": str(self._folder / "episodes"),
            "/opt/taskschema/deploy": str(ROOT / "deploy/ray"),
            "$$": "$",
        }
        for old, new in replaced.items():
            words = [word.replace(old, new) for word in words]
        return words

    def start(self, service: str, **own: str) -> "subprocess.Popen[str]":
        """Start a service, as its user of Redis; it ends with the test."""
        environment = {name: _default(value) for name, value in services()[service]["environment"].items()}
        url = environment.get("TASKSCHEMA_REDIS_URL", "")
        role = url.removeprefix("redis://").partition(":")[0]
        if role:
            environment["TASKSCHEMA_REDIS_URL"] = self._server.url(role)
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        places = {"TASKSCHEMA_RUNS": str(self._folder / "runs"), "PATH": path}
        with self.log(service).open("w") as log:
            process = self._stack.enter_context(
                subprocess.Popen(
                    self.command(service),
                    env={**os.environ, **environment, **own, **places},
                    cwd=self._folder,
                    stdout=log,
                    stderr=log,
                    text=True,
                )
            )
        self._stack.callback(process.terminate)
        return process

    def log(self, service: str) -> Path:
        return self._folder / f"{service}.log"

    def is_healthy(self, service: str) -> bool:
        (kind, check) = services()[service]["healthcheck"]["test"]
        assert kind == "CMD-SHELL"
        here = check.replace(f"{CONTROL_PORT:04X}", f"{self._port:04X}").replace("$$", "$")
        return subprocess.run(["sh", "-c", here]).returncode == 0


def _default(value: str) -> str:
    """Return a setting's value in the example."""
    name = value.removeprefix("${").partition(":")[0]
    return settings().get(name, value)


@pytest.mark.timeout(900)
def test_episodes_of_the_twin_reach_the_learner(server: RoleRedis, tmp_path: Path) -> None:
    run = settings()["TASKSCHEMA_ROBOT_RUN"]
    records = RunRecords(server.client("learner"))
    with ExitStack() as stack:
        profile = Profile(stack, server, tmp_path)
        assert not profile.is_healthy("robot-twin")
        profile.start("robot-twin")
        options = "--slots 2 --rounds 2 --until-success 0 --set ppo.minibatches=1"
        learner = profile.start("robot-learner", TASKSCHEMA_OPTIONS=options)
        wait_until(lambda: run in records.runs(), seconds=PATIENCE_SECONDS)
        wait_until(lambda: profile.is_healthy("robot-twin"), seconds=PATIENCE_SECONDS)
        assert not profile.is_healthy("robot")
        agent = profile.start("robot")
        wait_until(lambda: profile.is_healthy("robot") or agent.poll() is not None, seconds=PATIENCE_SECONDS)
        assert learner.wait(PATIENCE_SECONDS) == 0, profile.log("robot-learner").read_text()
        assert agent.wait(PATIENCE_SECONDS) == 0, profile.log("robot").read_text()
    folder = RunFolder.open(tmp_path / "runs" / run)
    assert [row.episodes for row in folder.read_metrics()] == [2, 4]
    assert (tmp_path / "episodes" / run / "episodes.csv").read_text().count("\n") == 5


def test_the_twin_is_reached_by_its_agent_alone() -> None:
    """It asks nobody for a password, so that it listens on loopback, which the agent shares."""
    found = services()
    assert found["robot"]["network_mode"] == "service:robot-twin"
    assert "networks" not in found["robot"]
    for service in PROFILE:
        assert found[service]["profiles"] == ["robot"]
        assert "ports" not in found[service]


def test_the_robot_has_a_run_of_its_own() -> None:
    """Robot and simulated workers never serve the same one."""
    example: dict[str, Any] = settings()
    assert example["TASKSCHEMA_ROBOT_RUN"] != example["TASKSCHEMA_RUN"]
    for service in ("robot-learner", "robot"):
        assert "${TASKSCHEMA_ROBOT_RUN:-robot-twin}" in services()[service]["environment"].values()
