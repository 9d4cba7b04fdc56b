"""Row 12: a round's wall time with one of two workers stopped (SIGSTOP) in the middle of it."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench.entry import Entry
from bench.service_process import TASK
from taskschema.bus.connection import connect
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.records import RunRecords
from taskschema.config import RunConfig
from taskschema.policies import PolicySnapshot
from taskschema.tasks.registry import get_task
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_learner.learner import Learner

RUN = "bench"
LEASE_SECONDS = 5.0
"""Lease timeout of the workers here; 15 by default."""
START_SECONDS = 60.0
"""Longest wait for the workers [s]."""


def measure(repeats: int, slots: int = 50, lease_seconds: float = LEASE_SECONDS) -> list[Entry]:
    config = RunConfig(task=TASK, slots=slots)
    with tempfile.TemporaryDirectory(prefix="bench-") as folder, EmbeddedRedis(Path(folder)) as redis:
        records = RunRecords(connect(redis.url))
        records.register_run(RUN, config)
        bus = LearnerBus(connect(redis.url), RUN, config)
        bus.acquire()
        workers = [_start_worker(redis.url, lease_seconds) for _ in range(2)]
        try:
            _wait_for(records, len(workers))
            snapshot = Learner(config, get_task(TASK)).snapshot()
            rounds = _Rounds(bus, snapshot, slots)
            undisturbed, beyond = [], []
            rounds.seconds()
            for _ in range(repeats):
                undisturbed.append(rounds.seconds())
                disturbed = rounds.seconds(stopped=workers[0].pid, after=0.5 * undisturbed[-1])
                beyond.append(disturbed - undisturbed[-1])
                print(
                    f"  {undisturbed[-1]:.1f} s undisturbed, {beyond[-1]:+.1f} s with one stopped", flush=True
                )
        finally:
            for worker in workers:
                worker.terminate()
                worker.wait()
    # Its slots are half of the round, and take the other worker as long as a round.
    target = lease_seconds + max(undisturbed)
    return [
        Entry.of(
            12, "a round's extra wall time with one of two workers stopped", beyond, "s", target, "lower"
        ),
        Entry.of(
            12, f"a round undisturbed; lease timeout {lease_seconds:g} s", undisturbed, "s", None, "lower"
        ),
    ]


def _start_worker(url: str, lease_seconds: float) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "taskschema_worker", "--run", RUN, "--lease-seconds", str(lease_seconds)]
    return subprocess.Popen(
        command, env={**os.environ, "TASKSCHEMA_REDIS_URL": url}, stderr=subprocess.DEVNULL
    )


def _wait_for(records: RunRecords, count: int) -> None:
    deadline = time.monotonic() + START_SECONDS
    while len(records.workers(RUN)) < count:
        if time.monotonic() > deadline:
            raise RuntimeError("The workers did not join the run.")
        time.sleep(0.1)


class _Rounds:
    """Rounds of one policy, one after the other."""

    def __init__(self, bus: LearnerBus, snapshot: PolicySnapshot, slots: int) -> None:
        self._bus = bus
        self._snapshot = snapshot
        self._slots = slots
        self._round = 0

    def seconds(self, stopped: int | None = None, after: float = 0.0) -> float:
        """Return how long a round takes, with the process `stopped` from `after` seconds until its end."""
        started = time.monotonic()
        self._bus.open_round(self._round, self._snapshot, range(self._slots))
        still = stopped is None
        while self._bus.missing:
            if not still and time.monotonic() - started >= after:
                os.kill(stopped, signal.SIGSTOP)  # type: ignore[arg-type]
                still = True
            self._bus.results(timeout=0.05)
        seconds = time.monotonic() - started
        self._bus.trim(self._round)
        self._round += 1
        if stopped is not None:
            os.kill(stopped, signal.SIGCONT)
            self.seconds()  # in which it delivers what nobody waits for any more
        return seconds
