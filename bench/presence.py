"""Measure what workers cost that are merely there: `python -m bench.presence`.

Their signs of life and their asking for work, and the learner's memory by the slots of a round. What is
measured stands in `bench/growth.json`, the table that follows from it in docs/scale.md.
"""

import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from bench import growth, learner_memory, report
from bench.cluster_needs import WORKERS
from bench.saturation import sample_message
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

RUN = "bench"
BEATING = 100
"""Workers whose signs of life are measured together."""
BEATING_SECONDS = 5.0
ASKS = 200
"""Questions for work that are measured together."""


def main() -> None:
    """Measure, keep it, and bring the pages up to date."""
    growth.write(presence=measure())
    report.main()


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


if __name__ == "__main__":
    main()
