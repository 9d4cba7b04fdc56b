"""Where one learner and one Redis saturate: what a slot and an update cost them, with real messages."""

import dataclasses
import multiprocessing
import tempfile
import time
from collections import defaultdict
from multiprocessing.synchronize import Event
from pathlib import Path
from statistics import median
from typing import Any

from bench import growth
from bench.entry import Entry
from bench.recorded_rounds import collect
from bench.service_process import TASK
from taskschema.bus.connection import connect
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import RunConfig
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema.trajectory import Trajectory, TrajectoryFormat, decode_slot, encode_slot
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_learner.learner import Learner
from taskschema_worker.scene_environment import SceneEnvironment

RUN = "bench"
SLOTS = (50, 100, 200, 400)
"""Slots a round whose update is timed; the last is the size of the rounds sent through Redis."""
BATCHES = (1, 2, 4, 7, 13, 25, 50)
"""Slots that one worker runs as a batch: shares of a round."""
CLIENTS = 2


def measure(repeats: int, slots: tuple[int, ...] = SLOTS, batches: tuple[int, ...] = BATCHES) -> list[Entry]:
    """Write the parts' costs; they are figures of the growth table, not of the table of rows."""
    rollouts, sample = _rollout_seconds(repeats, batches)
    updates = {count: median(_update_seconds(sample, count) for _ in range(repeats)) for count in slots}
    costs = [_bus_seconds(sample, slots[-1]) for _ in range(repeats)]
    parts = growth.Parts(
        rollout_seconds=rollouts,
        update_seconds=updates,
        intake_seconds=median(intake for intake, _ in costs),
        redis_seconds=median(redis for _, redis in costs),
        message_bytes=len(encode_slot(sample)),
    )
    growth.write(parts=parts)
    print(
        f"  update of {slots[0]} slots {1e3 * updates[slots[0]]:.0f} ms; "
        f"a slot: learner {1e3 * parts.intake_seconds:.2f} ms, Redis {1e3 * parts.redis_seconds:.2f} ms"
    )
    return []


def _rollout_seconds(repeats: int, batches: tuple[int, ...]) -> tuple[dict[int, float], list[Trajectory]]:
    """Return what batches of slots take one worker, in processor time, and a slot's trajectories."""
    config, task = RunConfig(task=TASK), get_task(TASK)
    assert isinstance(task, SceneTask)
    environment, snapshot = SceneEnvironment(task), Learner(config, task).snapshot()
    sample = collect(environment, task, config, snapshot, 0, range(1))
    samples: defaultdict[int, list[float]] = defaultdict(list)
    for round_index in range(repeats):
        for size in batches:
            started = time.thread_time()
            collect(environment, task, config, snapshot, round_index, range(size))
            samples[size].append(time.thread_time() - started)
    environment.close()
    return {size: median(seconds) for size, seconds in samples.items()}, sample


def sample_message() -> bytes:
    """Return the message of one slot that a worker has run."""
    return encode_slot(_rollout_seconds(1, BATCHES[:1])[1])


def _as_slot(sample: list[Trajectory], slot: int) -> list[Trajectory]:
    return [dataclasses.replace(item, slot=slot) for item in sample]


def _update_seconds(sample: list[Trajectory], slots: int) -> float:
    config = RunConfig(task=TASK, slots=slots)
    task = get_task(TASK)
    learner = Learner(config, task)
    # As they arrive: decoded from messages.
    expected = TrajectoryFormat.of(task, config)
    trajectories = [
        item for slot in range(slots) for item in decode_slot(encode_slot(_as_slot(sample, slot)), expected)
    ]
    started = time.thread_time()
    learner.update(trajectories)
    return time.thread_time() - started


def _bus_seconds(sample: list[Trajectory], slots: int) -> tuple[float, float]:
    """Return processor time a slot of the learner's intake and of Redis [s]."""
    config = RunConfig(task=TASK, slots=slots)
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory(prefix="bench-") as folder, EmbeddedRedis(Path(folder)) as redis:
        client = connect(redis.url)
        RunRecords(client).register_run(RUN, config)
        bus = LearnerBus(connect(redis.url), RUN, config)
        bus.acquire()
        message = encode_slot(sample)
        done = context.Event()
        clients = [
            context.Process(target=_deliver, args=(redis.url, i, message, done)) for i in range(CLIENTS)
        ]
        for process in clients:
            process.start()
        while len(RunRecords(client).workers(RUN)) < CLIENTS:
            time.sleep(0.05)
        snapshot = Learner(config, get_task(TASK)).snapshot()
        redis_before, started = _redis_cpu(client), time.thread_time()
        bus.open_round(0, snapshot, range(slots))
        while bus.missing:
            bus.results(timeout=1.0)
        bus.trim(0)
        intake, redis_seconds = time.thread_time() - started, _redis_cpu(client) - redis_before
        done.set()
        for process in clients:
            process.join()
    return intake / slots, redis_seconds / slots


def _redis_cpu(client: Any) -> float:
    info = client.info("cpu")
    return float(info["used_cpu_user"] + info["used_cpu_sys"])


def _deliver(url: str, number: int, message: bytes, done: Event) -> None:
    """Lease slots and deliver the same trajectories for each at once."""
    config, task = RunConfig(task=TASK), get_task(TASK)
    expected = TrajectoryFormat.of(task, config)
    sample = decode_slot(message, expected)
    with WorkerBus(connect(url), RUN, f"bench-{number}") as bus:
        while not done.is_set():
            bus.submit([(lease, _as_slot(sample, lease.item.slot)) for lease in bus.lease(100)])
