"""How cost grows: what `scaling` and `saturation` measure, and what follows for a cluster."""

import json
from pathlib import Path

import msgspec
import numpy as np

from taskschema_learner.machine import machine, today

FILE = Path(__file__).with_name("growth.json")
EPISODES_PER_SLOT = 4


class WorkerCount(msgspec.Struct, frozen=True):
    """A number of workers on the machine's cores."""

    workers: int
    episodes_per_second: float
    seconds_per_round: float
    repeats: int


class Parts(msgspec.Struct, frozen=True):
    """What one slot and one update cost, in processor time, each on one core."""

    rollout_seconds: dict[int, float]
    """A worker's physics and planning, by the slots of its batch [s]."""
    update_seconds: dict[int, float]
    """Learner's update by slots a round [s]."""
    intake_seconds: float
    """Learner's reading, checking and decoding of a slot [s]."""
    redis_seconds: float
    """Redis's work for a slot: offer, lease, delivery, trimming [s]."""
    message_bytes: int
    """Size of a slot's message."""


class Presence(msgspec.Struct, frozen=True):
    """What workers cost that are merely there, and what their number costs the learner."""

    beat_seconds: float
    """Redis's processor time of a sign of life [s]; each worker gives one a second."""
    ask_seconds: dict[int, float]
    """Redis's processor time of a question for work, by the number of workers [s]."""
    ask_bytes: dict[int, float]
    """What it answers [bytes]."""
    policy_bytes: int
    """Size of a policy, which every worker fetches once a round."""
    learner_bytes: dict[int, int]
    """Memory that a learner has needed at most, by slots a round [bytes]."""


class Containers(msgspec.Struct, frozen=True):
    """What worker containers hold, as `tests.compose.many_workers` measures them."""

    workers: int
    """Containers, each a Ray node with one actor."""
    worker_bytes: float
    """The largest one [bytes]."""
    head_bytes: float
    """Ray's head, which knows all of them [bytes]."""


class Growth(msgspec.Struct, frozen=True):
    """Everything measured."""

    machine: str
    counts: tuple[WorkerCount, ...] = ()
    parts: Parts | None = None
    presence: Presence | None = None
    containers: Containers | None = None
    days: dict[str, str] = {}
    """When each of them was measured."""


class Cluster(msgspec.Struct, frozen=True):
    """A predicted round on a cluster, one worker a core, learner and Redis on cores of their own."""

    workers: int
    slots: int
    seconds_per_round: float
    episodes_per_second: float
    learner_share: float
    """Share of the round in which workers wait for the learner."""


def read(path: Path = FILE) -> Growth:
    return msgspec.json.decode(path.read_bytes(), type=Growth)


def write(path: Path = FILE, **changes: object) -> None:
    """Change some of what is measured and keep the rest."""
    before = read(path) if path.exists() else Growth("")
    days = before.days | dict.fromkeys(changes, today())
    changed = msgspec.structs.replace(before, machine=machine(), days=days, **changes)
    data = msgspec.to_builtins(changed, str_keys=True)
    path.write_text(json.dumps(data, indent=1) + "\n")


def predict(parts: Parts, workers: int, slots: int) -> Cluster:
    """Return a round on so many cores.

    A round's slots go to the workers in equal shares, and the largest sets how long collecting takes; the
    learner's intake and Redis work at the same time and bound it, too. The update follows.
    """
    share = -(-slots // workers)
    collect = max(
        _interpolated(parts.rollout_seconds, share), slots * parts.intake_seconds, slots * parts.redis_seconds
    )
    update = _interpolated(parts.update_seconds, slots)
    seconds = collect + update
    return Cluster(workers, slots, seconds, slots * EPISODES_PER_SLOT / seconds, update / seconds)


def saturation(parts: Parts) -> dict[str, tuple[float, float]]:
    """Return the trajectories per second that each part can take, and how many workers make as many."""
    largest = max(parts.rollout_seconds)
    rate = EPISODES_PER_SLOT * largest / parts.rollout_seconds[largest]
    slots = max(parts.update_seconds)
    seconds = {
        f"learner's update, {slots} slots a round": parts.update_seconds[slots] / slots,
        "learner's intake": parts.intake_seconds,
        "Redis": parts.redis_seconds,
    }
    episodes = {name: EPISODES_PER_SLOT / value for name, value in seconds.items()}
    return {name: (value, value / rate) for name, value in episodes.items()}


def _interpolated(seconds: dict[int, float], slots: int) -> float:
    """Return the time for so many slots, linear between those measured and in proportion beyond them."""
    known = sorted(seconds)
    if slots > known[-1]:
        return seconds[known[-1]] * slots / known[-1]
    return float(np.interp(slots, known, [seconds[size] for size in known]))
