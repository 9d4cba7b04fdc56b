"""Rows 5 and 11, and how cost grows with the number of workers on the same cores."""

from collections import defaultdict
from statistics import median

from bench import growth
from bench.entry import Entry
from bench.service_process import ServiceProcess, seconds
from taskschema.config import RunConfig

WORKERS = (1, 2, 50, 4, 8, 16)
"""Workers, run after run; the first three are compared with each other."""
ROUNDS = 4
"""Rounds a run, once all workers are there."""
MB = 1e6


def measure(repeats: int, counts: tuple[int, ...] = WORKERS, rounds: int = ROUNDS) -> list[Entry]:
    compared = counts[:3]
    round_seconds: defaultdict[int, list[float]] = defaultdict(list)
    largest: defaultdict[int, list[float]] = defaultdict(list)
    starts, typical = [], []
    for _ in range(repeats):
        for workers in counts:
            with ServiceProcess(workers) as service:
                started = service.wait_for_workers()
                rows = service.wait_for_rounds(rounds)
                actors = service.memory()[0]
            round_seconds[workers].append(seconds(rows) / len(rows))
            largest[workers].append(max(actors) / MB)
            if workers == compared[2]:
                starts.append(started)
                typical.append(median(actors) / MB)
            print(
                f"  {workers} workers: up after {started:.0f} s, {round_seconds[workers][-1]:.2f} s a round, "
                f"{max(actors) / MB:.0f} MB the largest",
                flush=True,
            )
    _write(round_seconds)
    one, two, many = (round_seconds[workers] for workers in compared)
    label = f"{compared[2]} actors on fractional CPUs"
    return [
        Entry.of(5, "1 to 2 workers on 2 cores: efficiency", _ratios(one, two, 2), "x", 0.95, "higher"),
        Entry.of(
            5,
            f"{label} / {compared[1]} actors: episodes per second",
            _ratios(two, many, 1),
            "x",
            0.95,
            "higher",
        ),
        Entry.of(11, "one worker: own memory", largest[compared[0]], "MB", 120, "lower"),
        Entry.of(11, "two workers: own memory of the larger", largest[compared[1]], "MB", 120, "lower"),
        Entry.of(11, f"{label}: own memory of the largest", largest[compared[2]], "MB", 90, "lower"),
        Entry.of(11, f"{label}: own memory, median actor", typical, "MB", None, "lower"),
        Entry.of(11, f"{label}: all at work after the command", starts, "s", None, "lower"),
    ]


def _ratios(slow: list[float], fast: list[float], times: int) -> list[float]:
    return [a / b / times for a, b in zip(slow, fast, strict=True)]


def _write(round_seconds: dict[int, list[float]]) -> None:
    config = RunConfig(task="lateral-lifting")
    episodes = config.slots * config.episodes_per_slot
    counts = tuple(
        growth.WorkerCount(workers, episodes / median(samples), median(samples), len(samples))
        for workers, samples in sorted(round_seconds.items())
    )
    growth.write(counts=counts)
