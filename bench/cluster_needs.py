"""What 50, 500 and 5,000 workers need, from measured parts: the tables of docs/scale.md.

`python -m bench saturation` measures what a slot and an update cost, `python -m bench.presence` workers that
are merely there, `python -m tests.compose.many_workers 50 --write` what worker containers hold. All of it
stands in `bench/growth.json`.
"""

from bench import growth
from taskschema.bus.connection import LONGEST_BLOCK_MS
from taskschema.bus.worker_bus import MS_PER_AGENT, SHORTEST_BLOCK_MS

WORKERS = (50, 500, 5_000)
WORTHWHILE = 1.5
"""Twice as many workers are worth their cost while they make so many times as many episodes."""


def section(measured: growth.Growth) -> str:
    """Return what stands between the marks of the page.

    Raises:
        SystemExit: if something has not been measured yet.
    """
    parts, presence, containers = measured.parts, measured.presence, measured.containers
    if parts is None or presence is None or containers is None:
        raise SystemExit(
            "Some parts were not measured: run `python -m bench saturation`, `python -m bench.presence` and "
            "`python -m tests.compose.many_workers 50 --write`."
        )
    days = [
        f"{part} on {measured.days[part]}"
        for part in ("parts", "presence", "containers")
        if part in measured.days
    ]
    when = f": {', '.join(days)}" if days else ""
    lines = [
        f"Measured on {measured.machine}{when}.",
        "",
        *needs(parts, presence, containers),
        "",
        *limits(parts),
        "",
        *paces(parts),
    ]
    return "\n".join(lines)


def needs(parts: growth.Parts, presence: growth.Presence, containers: growth.Containers) -> list[str]:
    """Return the table: one slot a worker, each worker on a core of its own."""
    rows: dict[str, list[str]] = {}
    for count in WORKERS:
        needed = {
            **_time(parts, count),
            **_redis(parts, presence, count),
            **_network(parts, presence, count),
            **_memory(parts, presence, containers, count),
        }
        for name, value in needed.items():
            rows.setdefault(name, []).append(value)
    return [
        "One slot a worker and round, one core a worker; learner and Redis on cores of their own.",
        "",
        "| | " + " | ".join(f"{count:,} workers" for count in WORKERS) + " |",
        "|---|" + "---|" * len(WORKERS),
        *(f"| {name} | " + " | ".join(values) + " |" for name, values in rows.items()),
    ]


def _time(parts: growth.Parts, count: int) -> dict[str, str]:
    round_ = growth.predict(parts, count, count)
    return {
        "seconds a round": f"{round_.seconds_per_round:.2f}",
        "episodes per second": f"{round_.episodes_per_second:,.0f}",
        "of a round: learner takes results in": f"{_intake_share(parts, count):.0%}",
        "of a round: learner updates, workers wait": f"{round_.learner_share:.0%}",
    }


def _redis(parts: growth.Parts, presence: growth.Presence, count: int) -> dict[str, str]:
    seconds = growth.predict(parts, count, count).seconds_per_round
    return {
        "Redis: one core's time for slots": f"{count * parts.redis_seconds / seconds:.1%}",
        "Redis: one core's time for signs of life": f"{count * presence.beat_seconds:.1%}",
        "Redis: one core's time for asking, all idle": (
            f"{_asks_per_second(count) * presence.ask_seconds[count]:.1%}"
        ),
    }


def _network(parts: growth.Parts, presence: growth.Presence, count: int) -> dict[str, str]:
    rounds_per_second = 1 / growth.predict(parts, count, count).seconds_per_round
    megabytes = {
        "results to the learner": count * parts.message_bytes * rounds_per_second,
        "policy to the workers": count * presence.policy_bytes * rounds_per_second,
        "answers to asking, all idle": _asks_per_second(count) * presence.ask_bytes[count],
    }
    return {f"network: {name} [MB/s]": f"{size / 1e6:.1f}" for name, size in megabytes.items()}


def _memory(
    parts: growth.Parts, presence: growth.Presence, containers: growth.Containers, count: int
) -> dict[str, str]:
    measured = f"{containers.head_bytes / 2**30:.2f}" if count == containers.workers else "not measured"
    return {
        "memory: a round's results in Redis [MB]": f"{count * parts.message_bytes / 1e6:.1f}",
        "memory: learner, at most [GiB]": f"{presence.learner_bytes[count] / 2**30:.2f}",
        "memory: all workers, a container each [GiB]": f"{count * containers.worker_bytes / 2**30:,.0f}",
        "memory: Ray's head [GiB]": measured,
    }


def _intake_share(parts: growth.Parts, count: int) -> float:
    return count * parts.intake_seconds / growth.predict(parts, count, count).seconds_per_round


def _asks_per_second(count: int) -> float:
    """Return how often so many idle workers ask together while others hold slots [1/s]."""
    wait_ms = min(max(SHORTEST_BLOCK_MS, count * MS_PER_AGENT), LONGEST_BLOCK_MS)
    return 1e3 * count / wait_ms


def limits(parts: growth.Parts) -> list[str]:
    """Return where one learner stops being enough.

    There always is such a number: beyond what was measured every part grows in proportion, so that a round of
    twice the slots takes twice as long.
    """
    enough = next(count for count in range(10, 1_000_000, 10) if _gain(parts, count) < WORTHWHILE)
    intake = next(
        count for count in range(1, 1_000_000) if count * parts.intake_seconds >= parts.rollout_seconds[1]
    )
    here, twice = (growth.predict(parts, count, count) for count in (enough, 2 * enough))
    return [
        f"One learner is enough up to some {enough:,} workers with a slot each, "
        f"{here.episodes_per_second:,.0f} episodes per second: twice as many workers make "
        f"{twice.episodes_per_second:,.0f}, less than half more. From {intake:,} workers on, the learner "
        "takes longer to take in a round's results than a worker to make one."
    ]


def paces(parts: growth.Parts) -> list[str]:
    """Return what 500 workers wait for, and how many fill the learner's intake with large batches."""
    count, slot = 500, parts.rollout_seconds[1]
    round_ = growth.predict(parts, count, count)
    intake, update = count * parts.intake_seconds, round_.seconds_per_round * round_.learner_share
    _, full = growth.saturation(parts)["learner's intake"]
    return [
        f"A slot alone takes a worker {slot:.2f} s, {1e3 * slot / growth.EPISODES_PER_SLOT:.0f} ms an "
        f"episode. A round of {count} slots takes the learner {intake:.2f} s to take in and {update:.2f} s "
        "to update with. Workers that run "
        f"{max(parts.rollout_seconds)} slots as one batch fill its intake when they are {full:,.0f}."
    ]


def _gain(parts: growth.Parts, count: int) -> float:
    """Return how many times as many episodes twice as many workers make."""
    once, twice = (growth.predict(parts, each, each) for each in (count, 2 * count))
    return twice.episodes_per_second / once.episodes_per_second
