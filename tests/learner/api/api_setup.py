"""One run of the toy task in Redis, as a learner leaves it."""

from dataclasses import dataclass

import httpx
import numpy as np

from taskschema.bus.records import RunRecords
from taskschema.config import RunConfig
from taskschema.metrics import RoundMetrics
from taskschema.policies import PolicySnapshot
from taskschema.schema import SchemaView, entropy, softmax
from taskschema.tasks import get_task

RUN = "toy-schema-seed0"
TOKEN = "a-token-for-tests"
WEIGHTS = {
    "trunk.0.weight": (8, 9),
    "trunk.0.bias": (8,),
    "mean.weight": (6, 8),
    "mean.bias": (6,),
    "log_std.weight": (6, 8),
    "log_std.bias": (6,),
    "value.weight": (1, 8),
    "value.bias": (1,),
}
"""Shapes of a network for the toy task: D = 9 observations, A = 6 arguments."""


def snapshot(version: int) -> PolicySnapshot:
    rng = np.random.default_rng(version)
    weights = {name: rng.normal(size=shape).astype(np.float32) for name, shape in WEIGHTS.items()}
    logits = np.zeros((3, 9))
    logits[0, 0] = logits[1, 4] = version  # (reach, reach), then (raise, raise)
    return PolicySnapshot(version, weights, logits)


def metrics(version: int) -> RoundMetrics:
    logits = snapshot(version).logits
    return RoundMetrics(
        round=version - 1,
        policy_version=version,
        episodes=200 * version,
        steps=500 * version,
        physics_steps=0,
        diverged=1,
        refused=4,
        quarantined=2,
        success_rate=0.25,
        success_last_100=0.5,
        schema_entropy=tuple(entropy(logits).tolist()),
        schema_probability=tuple(softmax(logits).max(axis=-1).tolist()),
        policy_loss=-0.01,
        value_loss=0.2,
        argument_entropy=1.5,
        approximate_kl=0.001,
        clip_fraction=0.1,
        gradient_norm=0.4,
        seconds_collect=1.5,
        seconds_update=0.25,
        seconds_checkpoint=0.125,
        sha256=snapshot(version).sha256,
    )


def document(run: str, version: int):
    view = SchemaView(get_task("toy").pairs, snapshot(version).logits)
    return view.document(
        run=run, task="toy", version=version, used_steps=2, updated_at="2026-01-02T03:04:05+00:00"
    )


def publish(records: RunRecords, run: str, version: int) -> None:
    records.write_schema(document(run, version))
    records.write_policy(run, snapshot(version))
    records.write_metrics(run, metrics(version))
    records.set_progress(run, round_index=version, version=version)


def trained_run(records: RunRecords, run: str, versions: int = 3) -> None:
    records.delete_run(run)
    records.register_run(run, RunConfig(task="toy"))
    for version in range(1, versions + 1):
        publish(records, run, version)
    records.set_state(run, "running")


@dataclass
class Served:
    """A running API: `http` without, `owner` with the token."""

    http: httpx.Client
    owner: httpx.Client
    records: RunRecords
