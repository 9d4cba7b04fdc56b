"""How good a trained policy is on instances that it was not trained on."""

import math
import os
from collections.abc import Sequence
from contextlib import closing

import msgspec
import numpy as np

from taskschema.arrays import AnyArray
from taskschema.policies import ActingPolicy, Actions, PolicySnapshot, policy_of
from taskschema.tasks.registry import task_of
from taskschema.tasks.task import BatchEnvironment
from taskschema.trajectory import Trajectory
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import newest_policy
from taskschema_worker.environments import environment_of
from taskschema_worker.rollout import collect_slots

HELD_OUT = 2**63
"""Seeds of runs are below; evaluation adds it to the run's, so no instance was ever trained on."""
EPISODES_AT_ONCE = 50
"""Episodes in one batch; it bounds memory, and results do not depend on it."""
NORMAL_97_5 = 1.959963984540054
"""The normal distribution's quantile behind 95 % intervals."""


class SuccessRate(msgspec.Struct, frozen=True):
    """Successes among some episodes, with the 95 % confidence interval of their probability (Wilson)."""

    successes: int
    episodes: int
    rate: float
    low: float
    high: float


class Evaluation(msgspec.Struct, frozen=True):
    """A policy version on held-out instances, the same ones for both kinds of actions."""

    run: str
    policy_version: int
    sampled: SuccessRate
    """Skill pairs and arguments drawn, as in training."""
    mean: SuccessRate
    """The most probable skill pair and the mean arguments."""


class MeanPolicy:
    """A policy that takes the most probable pair and the mean arguments instead of drawing them."""

    def __init__(self, policy: ActingPolicy) -> None:
        self.snapshot = policy.snapshot
        self.act_mean = policy.act_mean

    def act(self, observations: AnyArray, step: int, generators: Sequence[np.random.Generator]) -> Actions:
        """Return mean actions; the generators stay as they are."""
        return self.act_mean(observations, step)


def wilson(successes: int, episodes: int) -> SuccessRate:
    """Return the rate of successes among n > 0 episodes with Wilson's 95 % interval.

    center = (p + z^2 / 2n) / (1 + z^2 / n), half-width = z sqrt(p (1 - p) / n + z^2 / 4n^2) / (1 + z^2 / n).
    """
    rate, z2 = successes / episodes, NORMAL_97_5**2
    center = (rate + z2 / (2 * episodes)) / (1 + z2 / episodes)
    spread = math.sqrt(rate * (1 - rate) / episodes + z2 / (4 * episodes**2))
    half = NORMAL_97_5 * spread / (1 + z2 / episodes)
    return SuccessRate(successes, episodes, rate, max(0.0, center - half), min(1.0, center + half))


def evaluate(folder: RunFolder, episodes: int) -> Evaluation:
    """Run the newest policy on held-out instances, with sampled and with mean actions.

    Raises:
        RunFolderError: if the run has no policy yet, or a damaged one.

    """
    snapshot = newest_policy(folder)
    rates = []
    for mean in (False, True):
        trajectories = held_out_episodes(folder, snapshot, episodes, mean=mean)
        rates.append(wilson(sum(item.success for item in trajectories), episodes))
    return Evaluation(folder.name, snapshot.version, *rates)


def held_out_episodes(
    folder: RunFolder,
    snapshot: PolicySnapshot,
    episodes: int,
    *,
    mean: bool,
    environment: BatchEnvironment | None = None,
) -> list[Trajectory]:
    """Run a policy on the first held-out instances of a run, in this process, on all cores.

    They run in `environment`, which is then closed; without one, in a new one.
    """
    task = task_of(folder.config)
    drawing = policy_of(folder.config, task, snapshot)
    policy = MeanPolicy(drawing) if mean else drawing
    trajectories: list[Trajectory] = []
    threads = os.cpu_count() or 1
    with closing(environment or environment_of(folder.config, task, threads)) as environment:
        for start in range(0, episodes, EPISODES_AT_ONCE):
            slots = collect_slots(
                environment,
                policy,
                seed=folder.config.seed + HELD_OUT,
                round_index=0,
                slots=range(start, min(start + EPISODES_AT_ONCE, episodes)),
                episodes_per_slot=1,
                horizon=task.horizon,
            )
            trajectories += [trajectory for slot in slots for trajectory in slot]
    return trajectories
