"""What 50, 500 and 5,000 workers need, from measured parts.

`python -m bench saturation` measures what a slot and an update cost, `python -m tests.compose.many_workers 50
--write` what worker containers hold. `python -m bench.cluster_needs` adds the cost of workers that are merely
there, their signs of life and their asking for work, and the learner's memory. All of it stands in
`bench/growth.json`; the tables in docs/scale.md are written from that alone.
"""

import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from bench import growth, learner_memory
from bench.saturation import sample_message
from bench.service_process import TASK
from taskschema.bus.connection import LONGEST_BLOCK_MS, connect
from taskschema.bus.keys import RunKeys
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import MS_PER_AGENT, SHORTEST_BLOCK_MS, WorkerBus
from taskschema.config import RunConfig
from taskschema.tasks.registry import get_task
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_learner.learner import Learner

DOCUMENT = Path(__file__).parents[1] / "docs" / "scale.md"
BEGIN, END = "<!-- measured: written by python -m bench.cluster_needs -->", "<!-- end of measured -->"
WORKERS = (50, 500, 5_000)
RUN = "bench"
BEATING = 100
"""Workers whose signs of life are measured together."""
BEATING_SECONDS = 5.0
ASKS = 200
"""Questions for work that are measured together."""
WORTHWHILE = 1.5
"""Twice as many workers are worth their cost while they make so many times as many episodes."""


def main() -> None:
    """Measure, keep it, and bring the page up to date."""
    growth.write(presence=measure())
    text = section(growth.read())
    DOCUMENT.write_text(with_section(DOCUMENT.read_text(encoding="utf-8"), text), encoding="utf-8")
    print(text)


def section(measured: growth.Growth) -> str:
    """Return what stands between the marks of the page.

    Raises:
        SystemExit: if something has not been measured yet.
    """
    parts, presence, containers = measured.parts, measured.presence, measured.containers
    if parts is None or presence is None or containers is None:
        raise SystemExit(f"Some parts were not measured: {(__doc__ or '').partition('.')[2].strip()}")
    lines = [f"Measured on {measured.machine}.", "", *needs(parts, presence, containers), "", *limits(parts)]
    return "\n".join(lines)


def with_section(document: str, text: str) -> str:
    """Return the page with everything between its marks replaced.

    Raises:
        SystemExit: if a mark is gone.
    """
    before, begin, rest = document.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise SystemExit(f"{DOCUMENT} has lost its marks {BEGIN!r} and {END!r}.")
    return f"{before}{begin}\n\n{text}\n\n{end}{after}"


def measure(workers: tuple[int, ...] = WORKERS, seconds: float = BEATING_SECONDS) -> growth.Presence:
    """Measure with a real Redis and real messages."""
    config = RunConfig(task=TASK)
    snapshot = Learner(config, get_task(TASK)).snapshot()
    with tempfile.TemporaryDirectory(prefix="bench-") as folder, EmbeddedRedis(Path(folder)) as redis:
        client: Any = connect(redis.url)
        RunRecords(client).register_run(RUN, config)
        bus = LearnerBus(connect(redis.url), RUN, config)
        bus.acquire()
        bus.open_round(0, snapshot, [])
        beat = _beat_seconds(client, redis.url, seconds)
        asks = {count: _ask(client, redis.url, count) for count in workers}
    message = sample_message()
    return growth.Presence(
        beat_seconds=beat,
        ask_seconds={count: cost[0] for count, cost in asks.items()},
        ask_bytes={count: cost[1] for count, cost in asks.items()},
        policy_bytes=len(snapshot.to_bytes()),
        learner_bytes={count: learner_memory.measure(message, count) for count in workers},
    )


def _beat_seconds(client: Any, url: str, seconds: float) -> float:
    with ExitStack() as stack:
        for number in range(BEATING):
            stack.enter_context(WorkerBus(connect(url), RUN, f"beating-{number}"))
        before = _used(client)
        time.sleep(seconds)
        after = _used(client)
    return (after[0] - before[0]) / (BEATING * seconds)


def _ask(client: Any, url: str, workers: int) -> tuple[float, float]:
    """Return processor time [s] and bytes of one question for work while so many workers are there."""
    keys = RunKeys(RUN)
    later = time.time() + 3600  # they stay alive meanwhile
    names = [f"host-{number:05d}-1000-abcdef12" for number in range(workers - 1)]
    client.zadd(keys.heartbeats, dict.fromkeys(names, later))
    with WorkerBus(connect(url), RUN, "asking") as bus:
        before = _used(client)
        for _ in range(ASKS):
            bus.lease(1)
        after = _used(client)
    client.zrem(keys.heartbeats, *names)
    return (after[0] - before[0]) / ASKS, (after[1] - before[1]) / ASKS


def _used(client: Any) -> tuple[float, float]:
    """Return Redis's processor time [s] and the bytes it has sent."""
    info = client.info("everything")
    return float(info["used_cpu_user"] + info["used_cpu_sys"]), float(info["total_net_output_bytes"])


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


def _gain(parts: growth.Parts, count: int) -> float:
    """Return how many times as many episodes twice as many workers make."""
    once, twice = (growth.predict(parts, each, each) for each in (count, 2 * count))
    return twice.episodes_per_second / once.episodes_per_second


if __name__ == "__main__":
    main()
