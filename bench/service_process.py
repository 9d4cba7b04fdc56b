"""The whole service, as a user starts it: `taskschema train` with Redis, Ray, workers and API."""

import http.client
import json
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import psutil

from taskschema.errors import RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema_learner.runs.run_folder import RunFolder

TASK = "lateral-lifting"
PATIENCE_SECONDS = 300.0
"""Longest wait for workers or rounds [s]."""


class ServiceProcess:
    """A training of lateral lifting, endless, in a temporary folder, while it is entered."""

    def __init__(self, workers: int, seed: int = 0) -> None:
        self.workers = workers
        self._seed = seed

    def __enter__(self) -> Self:
        self._temporary = tempfile.TemporaryDirectory(prefix="bench-")
        self._folder = Path(self._temporary.name) / "run"
        self.port = free_port()
        command = [str(Path(sys.executable).with_name("taskschema")), "train", TASK]
        command += ["--seed", str(self._seed), "--workers", str(self.workers), "--until-success", "0"]
        command += ["--run-dir", str(self._folder), "--api", f"127.0.0.1:{self.port}"]
        self._log = (Path(self._temporary.name) / "log").open("wb")
        self.started = time.monotonic()
        self._process = subprocess.Popen(command, stdout=self._log, stderr=subprocess.STDOUT)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(30)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()
        self._temporary.cleanup()

    def rows(self) -> list[RoundMetrics]:
        """Return the rounds done so far."""
        try:
            return RunFolder.open(self._folder).read_metrics()
        except RunFolderError:
            return []

    def wait_for_rounds(self, count: int) -> list[RoundMetrics]:
        """Return the next `count` whole rounds, beginning with the second one from now."""
        first = len(self.rows()) + 1
        self._wait(lambda: len(self.rows()) >= first + count, f"{count} rounds")
        return self.rows()[first : first + count]

    def wait_for_workers(self) -> float:
        """Return when all workers live, in seconds since the start."""
        self._wait(lambda: self.live_workers() >= self.workers, f"{self.workers} workers")
        return time.monotonic() - self.started

    def live_workers(self) -> int:
        """Return how many workers the API says live."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
        try:
            connection.request("GET", "/workers")
            answer: dict[str, Any] = json.loads(connection.getresponse().read())
            return int(answer.get("live", 0))
        except (OSError, http.client.HTTPException, json.JSONDecodeError):
            return 0
        finally:
            connection.close()

    def memory(self) -> tuple[list[int], int]:
        """Return the own memory (USS) of each rollout actor, and that of the whole (sum of PSS) [bytes]."""
        actors, total = [], 0
        root = psutil.Process(self._process.pid)
        for process in [root, *root.children(recursive=True)]:
            try:
                info = process.memory_full_info()
                total += info.pss
                if "RolloutActor" in " ".join(process.cmdline()):
                    actors.append(info.uss)
            except psutil.Error:
                continue
        return actors, total

    def api_seconds(self) -> float:
        """Return the processor time that the API's process has taken so far [s]."""
        for process in psutil.Process(self._process.pid).children(recursive=True):
            if "taskschema_learner.api" in process.cmdline():
                times = process.cpu_times()
                return float(times.user + times.system)
        raise RuntimeError("The API's process is gone.")

    def _wait(self, condition: Any, what: str) -> None:
        deadline = time.monotonic() + PATIENCE_SECONDS
        while not condition():
            if self._process.poll() is not None or time.monotonic() > deadline:
                text = Path(self._log.name).read_text(errors="replace")
                raise RuntimeError(f"The service did not come to {what}:\n{text[-2000:]}")
            time.sleep(0.1)


def seconds(rows: list[RoundMetrics]) -> float:
    """Return the wall time of rounds [s]."""
    return sum(row.seconds_collect + row.seconds_update + row.seconds_checkpoint for row in rows)


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
