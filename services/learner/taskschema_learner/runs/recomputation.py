"""Computing a run again from its config and seed, in this process, without Redis and Ray."""

import os
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass

from taskschema.arrays import Float32Array
from taskschema.config import RunConfig
from taskschema.policies import PolicySnapshot, policy_of
from taskschema.tasks.registry import task_of
from taskschema.trajectory import Trajectory
from taskschema_learner.learner import Learner
from taskschema_worker.environments import environment_of
from taskschema_worker.rollout import collect_slots

SLOTS_AT_ONCE = 10
"""Slots in one batch; it bounds memory, and results do not depend on it."""


@dataclass(frozen=True)
class RecomputedRound:
    """One round, computed again."""

    round: int
    trajectories: list[Trajectory]
    """All episodes of the round, sorted by slot and episode."""
    sha256: str
    """Hash of the policy after the round's update."""


def recompute(
    config: RunConfig,
    rounds: int,
    trunk: dict[str, Float32Array] | None = None,
    initial_policy: PolicySnapshot | None = None,
    device: str = "cpu",
) -> Iterator[RecomputedRound]:
    """Train from the start as the run did and yield its first rounds one by one; arguments as of `Learner`.

    A run is a function of its config and seed, so in the same environment (same lock file, same kind of
    processor) this gives the same bits as any number of workers did.

    Raises:
        TaskschemaError: if the run's task cannot be made.

    """
    task = task_of(config)
    learner = Learner(config, task, device, trunk, initial_policy)
    with closing(environment_of(config, task, os.cpu_count() or 1)) as environment:
        for number in range(rounds):
            policy = policy_of(config, task, learner.snapshot())
            trajectories = [
                trajectory
                for start in range(0, config.slots, SLOTS_AT_ONCE)
                for slot in collect_slots(
                    environment,
                    policy,
                    seed=config.seed,
                    round_index=number,
                    slots=range(start, min(start + SLOTS_AT_ONCE, config.slots)),
                    episodes_per_slot=config.episodes_per_slot,
                    horizon=task.horizon,
                )
                for trajectory in slot
            ]
            learner.update(trajectories)
            yield RecomputedRound(number, trajectories, learner.snapshot().sha256)
