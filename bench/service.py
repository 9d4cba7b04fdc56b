"""Rows 2, 7 and 13: the whole service while it trains, beside the same rollouts and the same physics alone.

Every repeat runs one after the other: the service (Redis, Ray, workers, learner, API); the same rounds'
rollouts in as many processes with nothing else; the same physics in as many processes through bare
`mujoco.rollout`.
"""

import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from bench.entry import Entry
from bench.processes import run_together
from bench.recorded_rounds import RecordedRounds, Replay, collect, record, worker_slots
from bench.service_process import TASK, ServiceProcess, seconds
from taskschema.policies import Policy
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema.trajectory import Trajectory, encode_slot
from taskschema_worker.mixed_path import MixedPath
from taskschema_worker.scene_environment import SceneEnvironment

WORKERS = 2
RECORDED = 10
"""Rounds recorded; the service joins them somewhere after its workers are there."""
ROUNDS = 4
"""Rounds a repeat."""
MIB = 2**20


def measure(repeats: int, rounds: int = ROUNDS, recorded_rounds: int = RECORDED) -> list[Entry]:
    """Return share of the raw limit, shares of everything else, episodes per second, and memory."""
    samples: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        recorded = record(Path(folder), recorded_rounds, WORKERS)
        for _ in range(repeats):
            samples.append(_repeat(recorded, rounds))
            print("  " + ", ".join(f"{name} {value:.3g}" for name, value in samples[-1].items()), flush=True)

    def entry(id: int, name: str, key: str, unit: str, target: float | None, better: str) -> Entry:
        return Entry.of(id, name, [sample[key] for sample in samples], unit, target, better)

    return [
        entry(2, "physics replayed bare / training, whole service", "raw", "x", 0.93, "higher"),
        entry(7, "learner: update and checkpoint, share of the wall time", "learner", "%", None, "lower"),
        entry(7, "encoding, share", "encoding", "%", None, "lower"),
        entry(7, "transport and waiting for the slower worker, share", "transport", "%", None, "lower"),
        entry(7, "policy inference, share", "inference", "%", None, "lower"),
        entry(7, "planning, share", "planning", "%", None, "lower"),
        entry(7, "all of these together, share of the wall time", "all", "%", 5, "lower"),
        entry(13, "episodes of up to three skills while training", "rate", "1/s", 30, "higher"),
        entry(13, "memory of the whole embedded run", "memory", "MiB", 2048, "lower"),
    ]


def _repeat(recorded: RecordedRounds, rounds: int) -> dict[str, float]:
    config = recorded.config
    with ServiceProcess(WORKERS) as service:
        service.wait_for_workers()
        rows = service.wait_for_rounds(rounds)
        memory = service.memory()[1]
    numbers = [row.round for row in rows]
    if [row.sha256 for row in rows] != [recorded.sha256[number] for number in numbers]:
        raise RuntimeError("The recorded rounds are not those that the service ran.")
    wall = seconds(rows)
    bare, parts = run_together(partial(_bare_rollouts, recorded, numbers), WORKERS)
    raw, _ = run_together(partial(_bare_physics, recorded, numbers), WORKERS)
    shares = {name: 100 * sum(part[name] for part in parts) / WORKERS / wall for name in PARTS}
    learner = 100 * sum(row.seconds_update + row.seconds_checkpoint for row in rows) / wall
    transport = 100 - learner - 100 * bare / wall
    return {
        "raw": raw / wall,
        "learner": learner,
        "transport": transport,
        **shares,
        "all": learner + transport + sum(shares.values()),
        "rate": len(rows) * config.slots * config.episodes_per_slot / wall,
        "memory": memory / MIB,
    }


PARTS = ("encoding", "inference", "planning")


def _bare_physics(recorded: RecordedRounds, rounds: list[int], worker: int) -> Callable[[], Any]:
    return Replay(recorded, rounds, worker, WORKERS)


def _bare_rollouts(
    recorded: RecordedRounds, rounds: list[int], worker: int
) -> Callable[[], dict[str, float]]:
    """Return rollouts of some rounds that say how long each part of them took [s]."""
    config, task, spent = recorded.config, get_task(TASK), Counter[str]()
    assert isinstance(task, SceneTask)
    # Planning turns arguments into set-points: waypoints, their timing, and samples for the simulator.
    _timed(SceneEnvironment, "plan", "planning", spent)
    _timed(MixedPath, "sample", "planning", spent)
    _timed(Policy, "act", "inference", spent)
    environment = SceneEnvironment(task)
    snapshots = [recorded.snapshot(number) for number in rounds]
    slots = worker_slots(config, worker, WORKERS)
    collect(environment, task, config, snapshots[0], 0, slots[:1])

    def work() -> dict[str, float]:
        spent.clear()
        trajectories: list[Trajectory] = []
        for number, snapshot in zip(rounds, snapshots, strict=True):
            trajectories += collect(environment, task, config, snapshot, number, slots)
        started = time.perf_counter()
        for start in range(0, len(trajectories), config.episodes_per_slot):
            encode_slot(trajectories[start : start + config.episodes_per_slot])
        spent["encoding"] += time.perf_counter() - started
        return {name: spent[name] for name in PARTS}

    return work


def _timed(owner: type, name: str, part: str, spent: Counter[str]) -> None:
    """Add the time that calls of a method take to its part [s]."""
    original = getattr(owner, name)

    def timed(*arguments: Any, **named: Any) -> Any:
        started = time.perf_counter()
        try:
            return original(*arguments, **named)
        finally:
            spent[part] += time.perf_counter() - started

    setattr(owner, name, timed)
