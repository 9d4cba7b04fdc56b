"""The compose file's profile `robot`: twin, agent and training by their own commands, no containers."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import redis
from bus_setup import wait_until
from compose_file import ROOT, services, settings
from role_redis import RoleRedis, role_redis

from taskschema.bus.keys import RunKeys
from taskschema.bus.records import RunRecords
from taskschema.bus.work_stream import work_entries
from taskschema_learner.runs.run_folder import RunFolder

PATIENCE_SECONDS = 240.0
"""For what takes seconds on an idle machine."""
PROFILE = ("robot-twin", "robot-learner", "robot")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[RoleRedis]:
    (tmp_path / "redis").mkdir()
    with role_redis(tmp_path / "redis") as running:
        yield running


class Profile:
    """Runs services as processes, whose volumes lie in a folder."""

    def __init__(self, stack: ExitStack, server: RoleRedis, folder: Path) -> None:
        self._stack, self._server, self._folder = stack, server, folder

    def command(self, service: str) -> list[str]:
        """Return a service's command, in this test's places."""
        words: list[str] = services()[service]["command"]
        return [
            self._here(word.replace("/opt/taskschema/deploy", str(ROOT / "deploy/ray"))) for word in words
        ]

    def _here(self, word: str) -> str:
        """Return a word with volumes in this test's folder."""
        for volume in ("/twin", "/episodes", "/runs"):
            word = word.replace(volume, str(self._folder / volume[1:]))
        return word.replace("$$", "$")

    def start(self, service: str, **own: str) -> "subprocess.Popen[str]":
        """Start a service, as its user of Redis; it ends with the test."""
        environment = {name: _default(value) for name, value in services()[service]["environment"].items()}
        url = environment.get("TASKSCHEMA_REDIS_URL", "")
        role = url.removeprefix("redis://").partition(":")[0]
        if role:
            environment["TASKSCHEMA_REDIS_URL"] = self._server.url(role)
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        places = {"TASKSCHEMA_RUNS": str(self._folder / "runs"), "PATH": path}
        with self.log(service).open("a") as log:
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
        self._stack.callback(process.kill)
        return process

    def log(self, service: str) -> Path:
        return self._folder / f"{service}.log"

    def is_healthy(self, service: str) -> bool:
        (kind, check) = services()[service]["healthcheck"]["test"]
        assert kind == "CMD-SHELL"
        environment = {name: _default(value) for name, value in services()[service]["environment"].items()}
        words = ["sh", "-c", self._here(check)]
        return subprocess.run(words, env=os.environ | environment, capture_output=True).returncode == 0


def _default(value: str) -> str:
    """Return a setting's value in the example."""
    name = value.removeprefix("${").partition(":")[0]
    return settings().get(name, value)


@pytest.mark.timeout(900)
def test_twin_and_agent_may_be_killed_at_any_time(server: RoleRedis, tmp_path: Path) -> None:
    run = settings()["TASKSCHEMA_ROBOT_RUN"]
    records = RunRecords(server.client("learner"))
    with ExitStack() as stack:
        profile = Profile(stack, server, tmp_path)
        assert not any(profile.is_healthy(service) for service in PROFILE)
        options = "--slots 2 --rounds 3 --until-success 0 --set ppo.minibatches=1"
        learner = profile.start("robot-learner", TASKSCHEMA_OPTIONS=options)
        twin = profile.start("robot-twin")
        wait_until(lambda: profile.is_healthy("robot-twin"), seconds=PATIENCE_SECONDS)
        wait_until(lambda: run in records.runs(), seconds=PATIENCE_SECONDS)
        assert profile.is_healthy("robot-learner")
        agent = profile.start("robot")
        wait_until(lambda: _leased_by(server, run) is not None, seconds=PATIENCE_SECONDS)
        assert profile.is_healthy("robot")
        twin.kill()
        assert agent.wait(PATIENCE_SECONDS) == 1, "so that its container is started again"
        assert "is gone" in profile.log("robot").read_text()
        assert not profile.is_healthy("robot")
        assert not profile.is_healthy("robot-twin")

        profile.start("robot-twin")
        wait_until(lambda: profile.is_healthy("robot-twin"), seconds=PATIENCE_SECONDS)
        agent = profile.start("robot")
        wait_until(lambda: _kill_with_lease(agent, server, run), seconds=PATIENCE_SECONDS)
        agent = profile.start("robot", TASKSCHEMA_LOG_FORMAT="json")
        assert learner.wait(PATIENCE_SECONDS) == 0, profile.log("robot-learner").read_text()
        assert agent.wait(PATIENCE_SECONDS) == 0, profile.log("robot").read_text()
        lines = [json.loads(line) for line in profile.log("robot").read_text().splitlines() if line[0] == "{"]
        assert {line["run"] for line in lines} == {run}
        assert lines[-1]["message"].startswith("The run is finished")
    folder = RunFolder.open(tmp_path / "runs" / run)
    assert [row.episodes for row in folder.read_metrics()] == [2, 4, 6]
    assert (tmp_path / "episodes" / run / "episodes.csv").read_text().count("\n") == 7


def _leased_by(server: RoleRedis, run: str) -> bytes | None:
    """Return who holds a lease of the run, if somebody does."""
    try:
        entries = work_entries(server.client("learner"), RunKeys(run))
    except redis.ResponseError:
        return None  # no round has been opened yet
    return next((entry.agent for entry in entries if entry.is_open and entry.agent), None)


def _kill_with_lease(agent: "subprocess.Popen[str]", server: RoleRedis, run: str) -> bool:
    """Kill the agent if it holds a lease, which it can then not hand back."""
    agent.send_signal(signal.SIGSTOP)
    if (_leased_by(server, run) or b"").startswith(b"robot-"):
        agent.kill()
        agent.wait()
        return True
    agent.send_signal(signal.SIGCONT)
    return False


def test_an_agent_and_its_twin_fall_and_rise_apart() -> None:
    """An engine starts no container into the network of one that is away, and does not try it again."""
    found = services()
    assert not [each["network_mode"] for each in found.values() if each.get("network_mode", "none") != "none"]
    assert found["robot"]["hostname"], "its leases' holder has the same name in a new container"


def test_the_twin_is_reached_by_its_agent_alone() -> None:
    """It asks nobody for a password, so that it listens at files which only its agent shares."""
    found = services()
    assert found["robot-twin"]["network_mode"] == "none"
    assert [name for name, each in found.items() if "twin:/twin" in each.get("volumes", [])] == [
        "robot-twin",
        "robot",
    ]
    for service in PROFILE:
        assert found[service]["profiles"] == ["robot"]
        assert "ports" not in found[service]


def test_the_robot_has_a_run_of_its_own() -> None:
    """Robot and simulated workers never serve the same one."""
    example: dict[str, Any] = settings()
    assert example["TASKSCHEMA_ROBOT_RUN"] != example["TASKSCHEMA_RUN"]
    for service in ("robot-learner", "robot"):
        assert "${TASKSCHEMA_ROBOT_RUN:-robot-twin}" in services()[service]["environment"].values()
