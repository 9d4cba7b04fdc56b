"""The training loop: collect a round, learn from it, make it durable, tell the world (docs/protocol.md)."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import NamedTuple, Protocol

import numpy as np

from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_info import AgentKind
from taskschema.logs import bind
from taskschema.metrics import RoundMetrics
from taskschema.policies import PolicySnapshot
from taskschema.schema import SchemaDocument, SchemaView, entropy, softmax
from taskschema.tasks.task import Task
from taskschema.trajectory import Trajectory
from taskschema_learner.learner import Learner, UpdateStatistics
from taskschema_learner.runs.progress import Limits, Progress
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_state import restore_run, save_run
from taskschema_learner.views.summaries import SummaryWriter

log = logging.getLogger("taskschema.learner")


@dataclass(frozen=True)
class TrainingContext:
    """A training as a whole: what it is about, and what an observer may want to show of it."""

    folder: RunFolder
    task: Task
    limits: Limits
    workers: int | None
    """Rollout actors that are asked for; None: none are started, see `agent`."""
    agent: AgentKind
    """Who runs the episodes; `simulation` without actors: this process."""
    api_url: str | None
    """Where the HTTP API answers; None: nowhere."""
    api_token: str | None
    """Token that was generated for it, so that somebody is told; None: the user's own."""


class TrainingObserver(Protocol):
    """Somebody who watches a training, such as the terminal."""

    def on_start(self, context: TrainingContext, rounds_done: int, progress: Progress) -> None:
        """Training starts, or goes on after `rounds_done` rounds."""

    def on_collecting(self, slots_done: int, slots: int) -> None:
        """Some slots of the current round came in."""

    def on_round(self, metrics: RoundMetrics, schema: SchemaView, used_steps: int | None) -> None:
        """A round is done and durable."""

    def on_finish(self, reason: str, finished: bool) -> None:
        """Training ended: for good if `finished`, else it can be resumed."""


@dataclass(frozen=True)
class Parts:
    """What the loop works with."""

    context: TrainingContext
    learner: Learner
    bus: LearnerBus
    records: RunRecords
    observer: TrainingObserver
    summaries: SummaryWriter
    tend_workers: Callable[[], object]
    """Called again and again while a round is collected: runs open slots in this process (`--workers 0`),
    or raises when the worker pool is beyond repair."""


class Seconds(NamedTuple):
    """Wall times of a round's phases [s]."""

    publish: float
    """From opening the round until its policy and slots are published."""
    collect: float
    """From opening the round to its last slot."""
    update: float


class Opening(NamedTuple):
    """When the open round was opened."""

    started: float
    """[s] of the monotonic clock."""
    seconds: float
    """Until its policy and slots were published [s]."""


class TrainingStoppedError(Exception):
    """Training was asked to stop between or within rounds; the run can be resumed."""


def train(parts: Parts, stop: threading.Event) -> str:
    """Train until a limit is reached and return which.

    Raises:
        TrainingStoppedError: if it was asked to stop before.
    """
    context, limits, folder = parts.context, parts.context.limits, parts.context.folder
    progress = restore_run(folder, parts.learner)
    parts.bus.restore_curve(folder.read_metrics())
    if parts.learner.version > 0:
        write_files(parts)
    parts.observer.on_start(context, parts.learner.version, progress)
    opening: Opening | None = None
    while (reason := limits.reached(progress, parts.learner.version)) is None:
        if opening is None:
            wait_while_paused(parts, stop)
            opening = open_round(parts)
        trajectories = collect_round(parts, stop)
        collected = time.monotonic()
        statistics = parts.learner.update(trajectories)
        updated = time.monotonic()
        progress = progress.after(trajectories)
        seconds = Seconds(opening.seconds, collected - opening.started, updated - collected)
        metrics = measure(parts, trajectories, statistics, progress, seconds)
        parts.bus.verify_token()
        metrics = save_run(folder, parts.learner, parts.bus.token, progress, metrics)
        # What is durable can be built upon: workers run the next round while the world is told of this one.
        goes_on = limits.reached(progress, parts.learner.version) is None
        paused = parts.records.pause_requested(folder.name)
        opening = open_round(parts) if goes_on and not paused else None
        publish(parts, metrics)
        parts.bus.trim(metrics.round)
        parts.observer.on_round(metrics, schema_view(parts), parts.learner.used_steps)
    return reason


def open_round(parts: Parts) -> Opening:
    """Publish the learner's policy, and offer every slot of the round that it is to collect."""
    started, round_index = time.monotonic(), parts.learner.version
    parts.bus.open_round(round_index, parts.learner.snapshot(), range(parts.context.folder.config.slots))
    return Opening(started, time.monotonic() - started)


def collect_round(parts: Parts, stop: threading.Event) -> list[Trajectory]:
    """Wait for every slot of the open round and return its trajectories, sorted by slot and episode."""
    bind(round=parts.learner.version)
    folder = parts.context.folder
    slots = folder.config.slots
    results: dict[int, list[Trajectory]] = {}
    while len(results) < slots:
        if stop.is_set() or parts.records.stop_requested(folder.name):
            raise TrainingStoppedError
        parts.tend_workers()
        for result in parts.bus.results(timeout=0.25):
            results[result.slot] = result.trajectories
            parts.observer.on_collecting(len(results), slots)
    return [trajectory for slot in sorted(results) for trajectory in results[slot]]


def wait_while_paused(parts: Parts, stop: threading.Event) -> None:
    """Return when the run is not paused."""
    records, run = parts.records, parts.context.folder.name
    if not records.pause_requested(run):
        return
    parts.bus.set_state("paused")
    log.warning("Paused: POST /runs/%s/resume goes on.", run)
    while records.pause_requested(run):
        if stop.wait(0.25) or records.stop_requested(run):
            raise TrainingStoppedError
    parts.bus.set_state("running")


def measure(
    parts: Parts,
    trajectories: list[Trajectory],
    statistics: UpdateStatistics,
    progress: Progress,
    seconds: Seconds,
) -> RoundMetrics:
    """Return the facts about a round but the time of its checkpoint."""
    logits = parts.learner.logits
    return RoundMetrics(
        round=parts.learner.version - 1,
        policy_version=parts.learner.version,
        episodes=progress.episodes,
        steps=progress.steps,
        physics_steps=sum(item.physics_steps for item in trajectories),
        diverged=sum(item.diverged for item in trajectories),
        refused=sum(item.refused for item in trajectories),
        quarantined=parts.bus.quarantined,
        success_rate=float(np.mean([item.success for item in trajectories])),
        success_last_100=progress.success_last_100,
        schema_entropy=tuple(entropy(logits).tolist()),
        schema_probability=tuple(softmax(logits).max(axis=-1).tolist()),
        policy_loss=statistics.policy_loss,
        value_loss=statistics.value_loss,
        argument_entropy=statistics.argument_entropy,
        approximate_kl=statistics.approximate_kl,
        clip_fraction=statistics.clip_fraction,
        gradient_norm=statistics.gradient_norm,
        seconds_publish=seconds.publish,
        seconds_collect=seconds.collect,
        seconds_update=seconds.update,
        sha256=parts.learner.snapshot().sha256,
    )


def publish(parts: Parts, metrics: RoundMetrics) -> None:
    """Show the new schema, policy and metrics to everybody: API, folder, TensorBoard."""
    snapshot, document = write_files(parts)
    parts.bus.publish_update(snapshot, document, metrics)
    parts.summaries.write(metrics)


def write_files(parts: Parts) -> tuple[PolicySnapshot, SchemaDocument]:
    """Write the newest schema and policy into the run's folder, and return them."""
    folder = parts.context.folder
    document = schema_view(parts).document(
        run=folder.name,
        task=parts.context.task.name,
        version=parts.learner.version,
        used_steps=parts.learner.used_steps,
        updated_at=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    snapshot = parts.learner.snapshot()
    folder.write_schema(document)
    folder.write_policy(snapshot.to_bytes())
    return snapshot, document


def schema_view(parts: Parts) -> SchemaView:
    """Return the current logits with the pairs that they are about."""
    return SchemaView(parts.context.task.pairs, parts.learner.logits)
