"""Row 4: the shipped physics against a fine reference, on a perturbed expert that fails half of the time."""

import os
from dataclasses import dataclass

import numpy as np

from bench.entry import Entry
from bench.reference_physics import PERTURBATION, blocks, perturbed_outcomes, reference_model
from taskschema.arrays import BoolArray
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask

EPISODES = 1_000
BLOCK = 200
SAME_OUTCOME, RATE_DIFFERENCE = 95.0, 1.5
"""Targets [%] and [percentage points]."""


@dataclass(frozen=True)
class Agreement:
    """How two physics compare over the same episodes."""

    shipped: BoolArray
    reference: BoolArray

    @property
    def same_outcome(self) -> float:
        """Share of episodes with the same outcome [%]."""
        return 100 * float(np.mean(self.shipped == self.reference))

    @property
    def rate_difference(self) -> float:
        """Difference of the success rates [percentage points]."""
        return 100 * abs(float(self.shipped.mean()) - float(self.reference.mean()))


def compare_physics(task: SceneTask, episodes: int = EPISODES, block: int = BLOCK) -> list[Agreement]:
    """Run the episodes on both physics, block by block."""
    threads = len(os.sched_getaffinity(0))
    model = reference_model(task)
    agreements = []
    for part in blocks(episodes, block):
        agreements.append(
            Agreement(
                perturbed_outcomes(task, None, part, threads), perturbed_outcomes(task, model, part, threads)
            )
        )
        print(f"  {part.stop} of {episodes}: {agreements[-1].same_outcome:.1f} % alike", flush=True)
    return agreements


def together(parts: list[Agreement]) -> Agreement:
    """Join blocks of episodes."""
    return Agreement(
        np.concatenate([part.shipped for part in parts]), np.concatenate([part.reference for part in parts])
    )


def measure(repeats: int, episodes: int = EPISODES) -> list[Entry]:
    """Compare every task; the spread is that of blocks of 200 episodes."""
    entries = []
    for name in PERTURBATION:
        task = get_task(name)
        assert isinstance(task, SceneTask)
        parts = compare_physics(task, episodes)
        whole = together(parts)
        print(f"  {name}: {whole.shipped.mean():.1%} shipped, {whole.reference.mean():.1%} reference succeed")
        same = [part.same_outcome for part in parts]
        apart = [part.rate_difference for part in parts]
        entries += [
            Entry(
                4,
                f"{name}: same outcome as the fine reference",
                whole.same_outcome,
                "%",
                SAME_OUTCOME,
                "higher",
                max(same) - min(same),
            ),
            Entry(
                4,
                f"{name}: difference of the success rates",
                whole.rate_difference,
                "points",
                RATE_DIFFERENCE,
                "lower",
                max(apart) - min(apart),
            ),
        ]
    return entries
