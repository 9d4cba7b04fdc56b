"""The compose stack under test: a project, settings and a port of its own."""

import json
import os
import re
import shlex
import socket
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from tests.compose.engine import ROOT

PROJECT = "taskschema-test"
RUN, ROBOT_RUN = "compose-test", "compose-test-robot"
ROBOT_SLOTS = 2
"""Episodes a round of the robot's run: the paper's 167 take minutes on the twin."""
PROFILES = ("--profile", "tools", "--profile", "robot", "--profile", "monitoring")
COMMAND_SECONDS = 1800.0
"""Longest wait for a command that builds, starts or trains [s]."""
DOCKER_SECONDS = 300.0
"""Longest wait for the engine's answer [s]."""


class Stack:
    """Commands to the stack and questions to its API.

    Args:
        compose: the command.
        folder: for its settings.
        task: that it trains.
        patience: longest wait for anything that the stack does by itself [s].

    """

    def __init__(self, compose: list[str], folder: Path, task: str, patience: float = 480.0) -> None:
        self._patience = patience
        self._settings = folder / "compose.env"
        self._port = _free_port()
        settings = subprocess.run(
            [ROOT / "deploy/docker/new-env.sh"], capture_output=True, text=True, check=True
        ).stdout
        own = {
            "API_ADDRESS": f"127.0.0.1:{self._port}",
            "TASKSCHEMA_TASK": task,
            "TASKSCHEMA_RUN": RUN,
            "TASKSCHEMA_OPTIONS": "--until-success 0",
            "TASKSCHEMA_ROBOT_RUN": ROBOT_RUN,
            "TASKSCHEMA_ROBOT_OPTIONS": f"--until-success 0 --slots {ROBOT_SLOTS} --set ppo.minibatches=1",
            "TORCH_INDEX_URL": os.environ.get("TORCH_INDEX_URL", ""),
        }
        lines = [line for line in settings.splitlines() if "=" in line and line[0] != "#"]
        self._values = dict(line.split("=", 1) for line in lines) | own
        self._write_settings()
        file = ["-f", str(ROOT / "docker-compose.yml"), "--project-directory", str(ROOT)]
        self._compose = [*compose, *file, "--env-file", str(self._settings), "-p", PROJECT]

    def _write_settings(self) -> None:
        self._settings.write_text("".join(f"{name}={value}\n" for name, value in self._values.items()))

    def change(self, name: str, value: str) -> None:
        """Change a setting for the commands that follow."""
        self._values[name] = value
        self._write_settings()

    @property
    def secrets(self) -> list[str]:
        """Everything that must not show."""
        return [value for name, value in self._values.items() if name.endswith(("_PASSWORD", "_TOKEN"))]

    def compose(self, *words: str) -> str:
        """Run a compose command and return what it prints.

        Raises:
            RuntimeError: if it fails; the message holds what it said.
        """
        return _output([*self._compose, *words], ROOT, " ".join(words))

    def shell(self, script: str) -> str:
        """Run what a page has a person type, about this stack and its run; return what it prints.

        Raises:
            RuntimeError: if a command in it fails; the message holds what it said.
        """
        # A person has a terminal, which these two take where nobody forbids it.
        here = re.sub(r"(run --rm|exec)( -T)? (tools|robot-twin)", r"\1 -T \3", script)
        places = {
            "docker compose": shlex.join(self._compose),
            "127.0.0.1:8420": f"127.0.0.1:{self._port}",
            ".env)": f"{self._settings})",
            "lateral-lifting": RUN,
        }
        for documented, own in places.items():
            here = here.replace(documented, own)
        return _output(["bash", "-euc", here], self._settings.parent, script)

    def clean(self) -> None:
        """Remove containers, networks and volumes, if there are any."""
        self.compose(*PROFILES, "down", "--volumes", "--remove-orphans")

    def containers(self, service: str | None = None) -> list[str]:
        """Return the ids of a service's running containers, or of all, oldest first."""
        words = ["--filter", f"label=com.docker.compose.project={PROJECT}"]
        if service is not None:
            words += ["--filter", f"label=com.docker.compose.service={service}"]
        return docker("ps", "-q", *words).split()[::-1]

    def health(self, service: str) -> str:
        """Return what the engine says about a service's one container, such as `running healthy`."""
        (container,) = self.containers(service)
        return docker("inspect", "--format", "{{.State.Status}} {{.State.Health.Status}}", container).strip()

    def engine_starts(self, service: str) -> int:
        """Return how often the engine itself has started a service's one container again."""
        (container,) = self.containers(service)
        return int(docker("inspect", "--format", "{{.RestartCount}}", container))

    def memory(self) -> dict[str, str]:
        """Return what each running container holds, by its name."""
        # Not by their ids: one that ends meanwhile would fail it all.
        lines = docker("stats", "--no-stream", "--format", "{{.Name}}={{.MemUsage}}").splitlines()
        used = dict(line.partition("/")[0].strip().split("=") for line in lines if line.startswith(PROJECT))
        return {name.removeprefix(PROJECT).strip("_-"): size for name, size in sorted(used.items())}

    def get(self, path: str) -> Any:
        """Return the API's answer.

        Raises:
            OSError: if there is none, or it is an error.
        """
        request = urllib.request.Request(f"http://127.0.0.1:{self._port}{path}", headers=self.headers)
        with urllib.request.urlopen(request, timeout=10) as answer:
            return json.load(answer)

    def post(self, path: str) -> Any:
        """Ask the API for something."""
        url = f"http://127.0.0.1:{self._port}{path}"
        request = urllib.request.Request(url, headers=self.headers, method="POST")
        with urllib.request.urlopen(request, timeout=10) as answer:
            return json.load(answer)

    @property
    def headers(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self._values['TASKSCHEMA_API_TOKEN']}"}

    def version(self, run: str = RUN) -> int:
        """Return the newest policy version: the number of finished rounds."""
        return int(self.get(f"/runs/{run}")["status"]["version"])

    def live_workers(self, run: str = RUN) -> int:
        return int(self.get(f"/workers?run={run}")["live"])

    def rounds_pass(self, count: int, run: str = RUN) -> float:
        """Wait for so many more rounds and return how long that took [s]."""
        started = time.monotonic()
        self.wait(lambda: self.version(run) >= 0, f"run {run}")
        goal = self.version(run) + count
        self.wait(lambda: self.version(run) >= goal, f"round {goal} of run {run}")
        return time.monotonic() - started

    def workers_become(self, count: int) -> float:
        """Wait until so many workers live and return how long that took [s]."""
        started = time.monotonic()
        self.wait(lambda: self.live_workers() == count, f"{count} workers")
        return time.monotonic() - started

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Poll until something is true.

        Raises:
            TimeoutError: if it does not come true.
        """
        deadline = time.monotonic() + self._patience
        while True:
            try:
                if condition():
                    return
            except (OSError, KeyError, json.JSONDecodeError):
                pass  # the API is away, or knows no run yet
            if time.monotonic() > deadline:
                raise TimeoutError(f"no sign of {what} after {self._patience:.0f} s")
            time.sleep(0.2)


def image_sizes() -> dict[str, int]:
    """Return what each image adds to the base that it starts from [bytes]."""
    sizes = {}
    for path in sorted((ROOT / "deploy/docker").glob("*.Dockerfile")):
        name = path.name.removesuffix(".Dockerfile")
        base = path.read_text(encoding="utf-8").partition("FROM ")[2].split()[0]
        for image in [name, "embedded"] if name == "learner" else [name]:
            sizes[image] = _size(f"taskschema-{image}:0.1.0") - _size(base)
    return sizes


def _size(image: str) -> int:
    return int(docker("image", "inspect", "--format", "{{.Size}}", image))


def docker(*words: str) -> str:
    """Run a docker command and return what it prints.

    Raises:
        RuntimeError: if it fails; the message holds what it said.
    """
    return _output(["docker", *words], ROOT, " ".join(words), DOCKER_SECONDS)


def dangling_images() -> set[str]:
    """Return the images that no name leads to any more."""
    return set(docker("image", "ls", "--quiet", "--no-trunc", "--filter", "dangling=true").split())


def remove_images(images: Iterable[str]) -> None:
    """Remove images, but for those that something else still needs."""
    for image in images:
        subprocess.run(["docker", "image", "rm", image], capture_output=True, timeout=DOCKER_SECONDS)


def _output(words: list[str], folder: Path, what: str, seconds: float = COMMAND_SECONDS) -> str:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=seconds)
    if done.returncode != 0:
        raise RuntimeError(f"{what}: {(done.stderr or done.stdout)[-3000:]}")
    return done.stdout


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])
