"""What agents and learner count while they work, for monitoring: it only grows, and outlives them.

Agents count in `leases`, the learner in `counters`: Redis lets no agent write what the learner counts. A
latency is a histogram: how often it fell into each of a few intervals, and the sum.
"""

from bisect import bisect_left
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from taskschema.metrics import RoundMetrics

BOUNDS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0)
"""Upper ends of a histogram's intervals [s]; the last interval has none."""
PHASES = ("publish", "collect", "update", "checkpoint")
"""Phases of a round whose wall times are kept."""
LEASE = "lease"
JOINED, LOST, TAKEN_OVER = "joined", "lost", "taken_over"
PHYSICS_STEPS, DIVERGED, REFUSED = "physics_steps", "diverged", "refused"
_SUM = "sum"


class Histogram(msgspec.Struct, frozen=True):
    """How long something took."""

    counts: tuple[int, ...] = (0,) * (len(BOUNDS) + 1)
    """How often it took up to each of `BOUNDS` but more than the one before, and longer than all."""
    total: float = 0.0
    """Sum of all times [s]."""

    def added(self, seconds: float) -> "Histogram":
        """Return the histogram with one more time."""
        counts = list(self.counts)
        counts[bisect_left(BOUNDS, seconds)] += 1
        return Histogram(tuple(counts), self.total + seconds)


class RunCounters(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that was counted about a run."""

    physics_steps: int = 0
    """Physics steps in all rounds."""
    diverged: int = 0
    """Episodes of all rounds whose simulation broke down."""
    refused: int = 0
    """Steps of all rounds that a safety gate refused."""
    workers_joined: int = 0
    """How often an agent joined: one that is restarted joins again."""
    workers_lost: int = 0
    """Agents that fell silent without leaving."""
    leases_taken_over: int = 0
    """Leases that an agent took from another, dead or gone."""
    learner_starts: int = 0
    """How often a learner took the run on."""
    phases: Mapping[str, Histogram] = {}
    """Wall time of the rounds, by phase."""
    leases: Histogram = Histogram()
    """Time from leasing a slot to delivering it."""

    @classmethod
    def of_rows(cls, rows: Iterable[RoundMetrics]) -> "RunCounters":
        """Return what the rounds alone tell."""
        physics_steps, diverged, refused = 0, 0, 0
        phases = dict.fromkeys(PHASES, Histogram())
        for row in rows:
            physics_steps, diverged = physics_steps + row.physics_steps, diverged + row.diverged
            refused += row.refused
            phases = {name: phases[name].added(getattr(row, f"seconds_{name}")) for name in PHASES}
        return cls(physics_steps=physics_steps, diverged=diverged, refused=refused, phases=phases)


def observe(client: Any, key: str, name: str, seconds: float, count: int = 1) -> None:  # noqa: ANN401 - or a pipeline
    """Count that something took so long, `count` times."""
    client.hincrby(key, f"{name}:{bisect_left(BOUNDS, seconds)}", count)
    client.hincrbyfloat(key, f"{name}:{_SUM}", seconds * count)


def observe_round(client: Any, key: str, row: RoundMetrics) -> None:  # noqa: ANN401 - or a pipeline
    """Count what a round adds."""
    client.hincrby(key, PHYSICS_STEPS, row.physics_steps)
    client.hincrby(key, DIVERGED, row.diverged)
    client.hincrby(key, REFUSED, row.refused)
    for name in PHASES:
        observe(client, key, name, getattr(row, f"seconds_{name}"))


def read_counters(
    counters: Mapping[bytes, bytes], leases: Mapping[bytes, bytes], fence: bytes | None
) -> RunCounters:
    """Return what the hashes `counters` and `leases` and the newest fencing token tell."""

    def integer(fields: Mapping[bytes, bytes], name: str) -> int:
        return int(fields.get(name.encode(), 0))

    return RunCounters(
        physics_steps=integer(counters, PHYSICS_STEPS),
        diverged=integer(counters, DIVERGED),
        refused=integer(counters, REFUSED),
        workers_joined=integer(leases, JOINED),
        workers_lost=integer(counters, LOST),
        leases_taken_over=integer(leases, TAKEN_OVER),
        learner_starts=int(fence or 0),
        phases={name: _histogram(counters, name) for name in PHASES},
        leases=_histogram(leases, LEASE),
    )


def _histogram(fields: Mapping[bytes, bytes], name: str) -> Histogram:
    counts = tuple(int(fields.get(f"{name}:{index}".encode(), 0)) for index in range(len(BOUNDS) + 1))
    return Histogram(counts, float(fields.get(f"{name}:{_SUM}".encode(), 0.0)))
