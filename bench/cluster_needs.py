"""What 50, 500 and 5,000 workers need, from measured parts.

`python -m bench saturation` measures what a slot and an update cost (`bench/growth.json`); here the cost of
workers that are merely there is added: their signs of life, and their asking for work. `python -m
bench.cluster_needs` writes docs/scale.md.
"""

import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec

from bench import growth
from bench.service_process import TASK
from taskschema.bus.connection import connect
from taskschema.bus.keys import RunKeys
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import RunConfig
from taskschema.tasks.registry import get_task
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_learner.learner import Learner
from taskschema_learner.machine import machine

DOCUMENT = Path(__file__).parents[1] / "docs" / "scale.md"
BEGIN, END = "<!-- measured: written by python -m bench.cluster_needs -->", "<!-- end of measured -->"
WORKERS = (50, 500, 5_000)
RUN = "bench"
BEATING = 100
"""Workers whose signs of life are measured together."""
BEATING_SECONDS = 5.0
ASKS = 200
"""Questions for work that are measured together."""
HALF = 0.5


class Presence(msgspec.Struct, frozen=True):
    """What workers cost Redis that are merely there."""

    beat_seconds: float
    """Processor time of a sign of life [s]; each worker gives one a second."""
    ask_seconds: dict[int, float]
    """Processor time of a question for work, by the number of workers [s]."""
    ask_bytes: dict[int, float]
    """What it answers [bytes]."""
    policy_bytes: int
    """Size of a policy, which every worker fetches once a round."""


def main() -> None:
    parts = growth.read().parts
    if parts is None:
        raise SystemExit("Measure the parts first: python -m bench saturation")
    presence = measure()
    text = "\n".join([f"Measured on {machine()}.", "", *needs(parts, presence), "", *limits(parts)])
    before, begin, rest = DOCUMENT.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise SystemExit(f"{DOCUMENT} has lost its marks {BEGIN!r} and {END!r}.")
    DOCUMENT.write_text(f"{before}{begin}\n\n{text}\n\n{end}{after}", encoding="utf-8")
    print(text)


def measure(workers: tuple[int, ...] = WORKERS, seconds: float = BEATING_SECONDS) -> Presence:
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
    return Presence(
        beat_seconds=beat,
        ask_seconds={count: cost[0] for count, cost in asks.items()},
        ask_bytes={count: cost[1] for count, cost in asks.items()},
        policy_bytes=len(snapshot.to_bytes()),
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


def needs(parts: growth.Parts, presence: Presence) -> list[str]:
    """Return the table: one slot a worker, each worker on a core of its own."""
    lines = [
        "One slot a worker and round, one core a worker; learner and Redis on cores of their own.",
        "",
        "| | " + " | ".join(f"{count:,} workers" for count in WORKERS) + " |",
        "|---|" + "---|" * len(WORKERS),
    ]
    rounds = {count: growth.predict(parts, count, count) for count in WORKERS}
    rows: dict[str, list[str]] = {}

    def row(name: str, values: list[str]) -> None:
        rows[name] = values

    row("seconds a round", [f"{rounds[count].seconds_per_round:.2f}" for count in WORKERS])
    row("episodes per second", [f"{rounds[count].episodes_per_second:,.0f}" for count in WORKERS])
    row(
        "time in which workers wait for the update",
        [f"{rounds[count].learner_share:.0%}" for count in WORKERS],
    )
    row(
        "Redis: one core's time for slots",
        [f"{count * parts.redis_seconds / rounds[count].seconds_per_round:.1%}" for count in WORKERS],
    )
    row(
        "Redis: one core's time for signs of life",
        [f"{count * presence.beat_seconds:.1%}" for count in WORKERS],
    )
    row(
        "Redis: one core's time for asking (once a second, idle)",
        [f"{count * presence.ask_seconds[count]:.1%}" for count in WORKERS],
    )
    row(
        "network: results to the learner [MB/s]",
        [f"{count * parts.message_bytes / rounds[count].seconds_per_round / 1e6:.1f}" for count in WORKERS],
    )
    row(
        "network: policy to the workers [MB/s]",
        [f"{count * presence.policy_bytes / rounds[count].seconds_per_round / 1e6:.1f}" for count in WORKERS],
    )
    row(
        "network: answers to asking [MB/s]",
        [f"{count * presence.ask_bytes[count] / 1e6:.1f}" for count in WORKERS],
    )
    row(
        "memory: a round's results in Redis [MB]",
        [f"{count * parts.message_bytes / 1e6:.1f}" for count in WORKERS],
    )
    return lines + [f"| {name} | " + " | ".join(values) + " |" for name, values in rows.items()]


def limits(parts: growth.Parts) -> list[str]:
    """Return where one learner stops being enough."""
    workers = next(
        count for count in range(50, 100_000, 10) if growth.predict(parts, count, count).learner_share >= HALF
    )
    round_ = growth.predict(parts, workers, workers)
    return [
        f"From {workers:,} workers with a slot each, half of every round is the learner's update: "
        f"{round_.episodes_per_second:,.0f} episodes per second, and more workers add less than half of what "
        "they cost."
    ]


if __name__ == "__main__":
    main()
