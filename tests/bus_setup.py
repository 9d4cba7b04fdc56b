"""Runs of the toy task on a real Redis, with both ends of the bus."""

import time
import uuid
from collections.abc import Callable, Sequence
from contextlib import ExitStack

import msgspec
import numpy as np

from taskschema.bus.admission import DATA, HEADER, SlotResult
from taskschema.bus.connection import connect
from taskschema.bus.keys import RunKeys
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.messages import SlotHeader
from taskschema.bus.records import RunRecords
from taskschema.bus.work_stream import work_entries
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import PROTOCOL_VERSION, RunConfig
from taskschema.metrics import RoundMetrics
from taskschema.policies import PolicySnapshot
from taskschema.schema import SchemaDocument, SchemaView
from taskschema.tasks.toy import Toy
from taskschema.trajectory import Trajectory, encode_slot

TOY = Toy()


def toy_snapshot(version: int = 0, seed: int = 0) -> PolicySnapshot:
    """Random weights: nothing but their hash and shape matters to the bus."""
    rng = np.random.default_rng((seed, version))

    def layer(rows: int, columns: int) -> np.ndarray:
        return (rng.standard_normal((rows, columns)) / np.sqrt(columns)).astype(np.float32)

    weights = {"trunk.0.weight": layer(64, TOY.observation.size), "trunk.0.bias": layer(64, 1)[:, 0]}
    for head, rows in (
        ("mean", TOY.pairs.argument_count),
        ("log_std", TOY.pairs.argument_count),
        ("value", 1),
    ):
        weights[f"{head}.weight"] = layer(rows, 64)
        weights[f"{head}.bias"] = np.zeros(rows, dtype=np.float32)
    return PolicySnapshot(version, weights, rng.standard_normal((TOY.horizon, len(TOY.pairs))))


def some_trajectories(slot: int, round_index: int = 0, episodes: int = 4) -> list[Trajectory]:
    """Trajectories of the right format; a function of slot and round, as real ones are."""
    rng = np.random.default_rng((slot, round_index))
    return [
        Trajectory(
            round=round_index,
            slot=slot,
            episode=episode,
            observations=rng.standard_normal((3, TOY.observation.size)).astype(np.float32),
            pairs=rng.integers(len(TOY.pairs), size=3),
            arguments=rng.standard_normal((3, TOY.pairs.argument_count)).astype(np.float32),
            success=False,
        )
        for episode in range(episodes)
    ]


def some_metrics(round_index: int) -> RoundMetrics:
    numbers = dict.fromkeys(RoundMetrics.__struct_fields__, 0.5)
    counts = ("episodes", "steps", "physics_steps", "diverged", "refused", "quarantined")
    integers = dict.fromkeys(counts, 1)
    return RoundMetrics(
        **{**numbers, **integers}
        | {
            "round": round_index,
            "policy_version": round_index + 1,
            "schema_entropy": (2.0, 2.0, 2.0),
            "schema_probability": (0.1, 0.1, 0.1),
            "sha256": "0" * 64,
        }
    )


def some_document(run: str, version: int) -> SchemaDocument:
    view = SchemaView(TOY.pairs, toy_snapshot(version).logits)
    return view.document(run=run, task="toy", version=version, used_steps=2, updated_at="2020-01-01T00:00:00")


class Run:
    """A registered run with a name of its own; whatever joined it leaves at the end."""

    def __init__(self, url: str, config: RunConfig | None = None) -> None:
        self.url = url
        self.name = f"test-{uuid.uuid4().hex[:12]}"
        self.keys = RunKeys(self.name)
        self.config = config or RunConfig(task="toy", slots=8)
        self.client = connect(url)
        self.records = RunRecords(self.client)
        self._stack = ExitStack()

    def __enter__(self) -> "Run":
        self.records.register_run(self.name, self.config)
        return self

    def __exit__(self, *unused: object) -> None:
        self._stack.close()
        self.records.delete_run(self.name)

    def learner(self) -> LearnerBus:
        bus = LearnerBus(connect(self.url), self.name, self.config)
        bus.acquire()
        return bus

    def worker(self, worker_id: str = "worker", lease_seconds: float = 15.0, cores: float = 1.0) -> WorkerBus:
        bus = WorkerBus(connect(self.url), self.name, worker_id, lease_seconds=lease_seconds, cores=cores)
        return self._stack.enter_context(bus)

    def send(self, header: object, data: bytes) -> None:
        """Push an entry past all that `WorkerBus` checks."""
        encoded = header if isinstance(header, bytes) else msgspec.json.encode(header)
        self.client.xadd(self.keys.trajectories, {HEADER: encoded, DATA: data})

    def header(self, slot: int, snapshot: PolicySnapshot) -> SlotHeader:
        config_hash = self.config.config_hash
        return SlotHeader(PROTOCOL_VERSION, config_hash, snapshot.version, slot, snapshot.sha256, "tester")

    def open_slots(self) -> list[int]:
        """Slots that are offered or leased, in order."""
        return [entry.item.slot for entry in work_entries(self.client, self.keys) if entry.is_open]


def deliver(worker: WorkerBus, block_ms: int = 1) -> list[int]:
    """Lease once and submit made-up trajectories; return the slots."""
    leases = worker.lease(block_ms)
    slots = [lease.item.slot for lease in leases]
    worker.submit([(lease, some_trajectories(lease.item.slot, lease.item.round)) for lease in leases])
    return slots


def gather(bus: LearnerBus, count: int, seconds: float = 20.0) -> list[SlotResult]:
    """Take results until there are `count`."""
    results: list[SlotResult] = []
    deadline = time.monotonic() + seconds
    while len(results) < count:
        assert time.monotonic() < deadline, f"{len(results)} of {count} results came in {seconds} s"
        results += bus.results(0.2)
    return results


def wait_until(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    """Wait for something that another process or thread does."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"nothing happened within {seconds} s"
        time.sleep(0.01)


def encoded(results: Sequence[SlotResult]) -> dict[int, bytes]:
    return {result.slot: encode_slot(result.trajectories) for result in results}
