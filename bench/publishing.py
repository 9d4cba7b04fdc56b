"""Row 8: from publishing a policy until an idle worker has it, on a real Redis and with a real worker."""

import multiprocessing
import tempfile
import threading
import time
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Event
from pathlib import Path

import numpy as np

from bench.entry import Entry
from bench.service_process import TASK
from taskschema.bus.connection import connect
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.lease import Lease
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import RunConfig
from taskschema.policies import PolicySnapshot
from taskschema.tasks.registry import get_task
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_learner.learner import Learner

RUN = "bench"
PUBLISHES = 60
"""A repeat."""
IDLE_SECONDS = 0.02
"""How long the worker has been idle when a policy is published, at least [s]."""


def measure(repeats: int, publishes: int = PUBLISHES) -> list[Entry]:
    """Publish policies of lateral lifting, each with one short slot, and see when the worker has them."""
    config = RunConfig(task=TASK, slots=1, episodes_per_slot=1)
    context = multiprocessing.get_context("spawn")
    arrivals: Queue[float] = context.Queue()
    stop = context.Event()
    with tempfile.TemporaryDirectory(prefix="bench-") as folder, EmbeddedRedis(Path(folder)) as redis:
        RunRecords(connect(redis.url)).register_run(RUN, config)
        bus = LearnerBus(connect(redis.url), RUN, config)
        bus.acquire()
        worker = context.Process(target=_work, args=(redis.url, arrivals, stop))
        worker.start()
        start = Learner(config, get_task(TASK)).snapshot()
        rng = np.random.default_rng(0)
        _publish(bus, start, 0, rng, arrivals)  # the worker starts
        samples = []
        for repeat in range(repeats):
            first = 1 + repeat * publishes
            delays = [
                _publish(bus, start, number, rng, arrivals) for number in range(first, first + publishes)
            ]
            samples.append(delays)
        stop.set()
        worker.join()
    together = np.concatenate(samples)
    entries = []
    for percent, target in ((50, 5.0), (99, 25.0)):
        each = [float(np.percentile(delays, percent)) for delays in samples]
        value, spread = float(np.percentile(together, percent)), max(each) - min(each)
        name = f"policy published until an idle worker has it, p{percent} of {len(together)}"
        entries.append(Entry(8, name, value, "ms", target, "lower", spread))
    return entries


def _publish(
    bus: LearnerBus, start: PolicySnapshot, number: int, rng: np.random.Generator, arrivals: "Queue[float]"
) -> float:
    """Publish one policy and return after how long the worker had it [ms]."""
    weights = {name: array + np.float32(1e-3 * number) for name, array in start.weights.items()}
    snapshot = PolicySnapshot(number, weights, start.logits)
    time.sleep(IDLE_SECONDS * (1 + rng.random()))
    started = time.monotonic()
    bus.open_round(number, snapshot, [0])
    arrived = arrivals.get(timeout=60)
    while bus.missing:
        bus.results(timeout=1.0)
    bus.trim(number)
    return 1e3 * (arrived - started)


def _work(url: str, arrivals: "Queue[float]", stop: Event) -> None:
    """Be a worker, and say when it has a policy: the monotonic clock is the machine's."""
    from taskschema_worker.worker import Worker

    bus = WorkerBus(connect(url), RUN, "bench-worker")
    policy_of = bus.policy

    def timed(lease: Lease) -> PolicySnapshot:
        snapshot = policy_of(lease)
        arrivals.put(time.monotonic())
        return snapshot

    bus.policy = timed  # type: ignore[method-assign]
    done = threading.Event()
    threading.Thread(target=lambda: (stop.wait(), done.set()), daemon=True).start()
    Worker(bus).run(done)
