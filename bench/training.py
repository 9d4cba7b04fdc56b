"""The whole service while it trains: episodes per second, what is not simulation, and memory.

A training of lateral lifting with the schema policy is compared with the same rollouts alone: the same
slots, on the same number of processes, without learner, Redis, Ray or API. What the service takes longer is
its share of learner, encoding, transport and waiting.
"""

import multiprocessing
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import psutil

from bench.entry import Entry
from taskschema.config import RunConfig
from taskschema_learner.run_folder import RunFolder

TASK = "lateral-lifting"
WORKERS = 2
ROUNDS = 6
"""Rounds a repeat; the first one, during which the workers start, is left out."""
MIB = 2**20


def measure(repeats: int) -> list[Entry]:
    rates, shares, actors, totals = [], [], [], []
    for _ in range(repeats):
        bare = bare_seconds()
        rate, seconds, actor, total = training()
        rates.append(rate)
        shares.append(100 * max(0.0, 1 - bare / seconds))
        actors.append(actor / MIB)
        totals.append(total / MIB)
    return [
        Entry.of(13, "episodes of three skills while training", rates, "1/s", 30, "higher"),
        Entry.of(
            7, "learner, encoding, transport and waiting, share of the wall time", shares, "%", 10, "lower"
        ),
        Entry.of(11, "own memory of a state worker", actors, "MiB", 120, "lower"),
        Entry.of(11, "memory of the whole embedded run", totals, "MiB", 2048, "lower"),
    ]


def training() -> tuple[float, float, float, float]:
    """Return episodes per second, seconds a round, a worker's own memory and the whole run's [bytes]."""
    with tempfile.TemporaryDirectory() as folder:
        run_dir = Path(folder) / "bench"
        command = [str(Path(sys.executable).with_name("taskschema")), "train", TASK, "--rounds", str(ROUNDS)]
        command += ["--until-success", "0", "--workers", str(WORKERS), "--run-dir", str(run_dir)]
        process = subprocess.Popen([*command, "--api", "127.0.0.1:0"], stdout=subprocess.DEVNULL)
        memory = _PeakMemory(process.pid)
        assert process.wait() == 0
        memory.stop()
        rows = RunFolder.open(run_dir).read_metrics()[1:]
    seconds = [row.seconds_collect + row.seconds_update + row.seconds_checkpoint for row in rows]
    config = RunConfig(task=TASK)
    episodes = len(rows) * config.slots * config.episodes_per_slot
    return episodes / sum(seconds), sum(seconds) / len(rows), memory.worker, memory.total


class _PeakMemory:
    """Watches a process and its children: peak own memory (USS) of a rollout actor, peak sum of PSS."""

    def __init__(self, pid: int) -> None:
        self.worker = self.total = 0.0
        self._root = psutil.Process(pid)
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()

    def stop(self) -> None:
        self._done.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._done.wait(0.5):
            total = 0.0
            try:
                family = [self._root, *self._root.children(recursive=True)]
            except psutil.NoSuchProcess:
                return
            for process in family:
                try:
                    info = process.memory_full_info()
                    total += info.pss
                    if "RolloutActor" in " ".join(process.cmdline()):
                        self.worker = max(self.worker, info.uss)
                except psutil.Error:
                    continue
            self.total = max(self.total, total)


def bare_seconds() -> float:
    """Return the seconds that the rollouts of a round take on `WORKERS` processes, nothing else running."""
    context = multiprocessing.get_context("spawn")
    ready, go = context.Barrier(WORKERS + 1), context.Barrier(WORKERS + 1)
    queue = context.Queue()
    processes = [
        context.Process(target=_roll_out, args=(index, ready, go, queue)) for index in range(WORKERS)
    ]
    for process in processes:
        process.start()
    ready.wait()
    started = time.monotonic()
    go.wait()
    for _ in processes:
        queue.get()
    seconds = time.monotonic() - started
    for process in processes:
        process.join()
    return seconds / (ROUNDS - 1)


def _roll_out(index: int, ready, go, queue) -> None:
    from taskschema.policies import Policy
    from taskschema.tasks import get_task
    from taskschema_learner.learner import Learner
    from taskschema_worker.environments import make_environment
    from taskschema_worker.rollout import collect_slots

    config = RunConfig(task=TASK)
    task = get_task(TASK)
    policy = Policy(Learner(config, task).snapshot(), task.pairs, task.observation)
    environment = make_environment(task)

    def rounds(numbers: range) -> None:
        for number in numbers:
            collect_slots(
                environment,
                policy,
                seed=config.seed,
                round_index=number,
                slots=range(index, config.slots, WORKERS),
                episodes_per_slot=config.episodes_per_slot,
                horizon=task.horizon,
            )

    rounds(range(1))
    ready.wait()
    go.wait()
    rounds(range(1, ROUNDS))
    queue.put(index)
