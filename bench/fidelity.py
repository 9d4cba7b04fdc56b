"""Row 4: the shipped physics against a fine reference, on a perturbed expert that fails half of the time."""

import os
from dataclasses import dataclass

import numpy as np

from bench.entry import Entry
from bench.reference_physics import (
    COARSER_TIMESTEP,
    PERTURBATION,
    blocks,
    perturbed_outcomes,
    reference_model,
)
from taskschema.arrays import BoolArray
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask

EPISODES = 1_000
BLOCK = 200
SAME_OUTCOME, RATE_DIFFERENCE = 95.0, 1.5
"""Targets [%] and [percentage points]."""


@dataclass(frozen=True)
class Agreement:
    """How the physics compare over the same episodes [N]: whether each succeeds."""

    shipped: BoolArray
    reference: BoolArray
    coarser: BoolArray
    """In the reference with steps of `COARSER_TIMESTEP`."""

    @property
    def same_outcome(self) -> float:
        """Share of episodes with the same outcome in shipped physics and reference [%]."""
        return 100 * float(np.mean(self.shipped == self.reference))

    @property
    def rate_difference(self) -> float:
        """Difference of the success rates of shipped physics and reference [percentage points]."""
        return 100 * abs(float(self.shipped.mean()) - float(self.reference.mean()))

    @property
    def same_in_references(self) -> float:
        """Share of episodes with the same outcome in both references [%]: no physics can do much better."""
        return 100 * float(np.mean(self.coarser == self.reference))


def compare_physics(task: SceneTask, episodes: int = EPISODES, block: int = BLOCK) -> list[Agreement]:
    """Run the episodes on all three physics, block by block."""
    threads = len(os.sched_getaffinity(0))
    models = (None, reference_model(task), reference_model(task, COARSER_TIMESTEP))
    agreements = []
    for part in blocks(episodes, block):
        agreements.append(Agreement(*(perturbed_outcomes(task, model, part, threads) for model in models)))
        print(f"  {part.stop} of {episodes}: {agreements[-1].same_outcome:.1f} % alike", flush=True)
    return agreements


def together(parts: list[Agreement]) -> Agreement:
    """Join blocks of episodes."""
    names = ("shipped", "reference", "coarser")
    return Agreement(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def measure(repeats: int, episodes: int = EPISODES) -> list[Entry]:
    """Compare every task."""
    entries = []
    for name in PERTURBATION:
        task = get_task(name)
        assert isinstance(task, SceneTask)
        parts = compare_physics(task, episodes)
        whole = together(parts)
        print(f"  {name}: {whole.shipped.mean():.1%} shipped, {whole.reference.mean():.1%} reference succeed")
        entries += _entries(name, parts, whole)
    return entries


def _entries(name: str, parts: list[Agreement], whole: Agreement) -> list[Entry]:
    """Return a task's figures; the spread is that of blocks of 200 episodes."""

    def entry(words: str, figure: str, unit: str, target: float | None, better: str) -> Entry:
        samples = [getattr(part, figure) for part in parts]
        spread = max(samples) - min(samples)
        return Entry(4, f"{name}: {words}", getattr(whole, figure), unit, target, better, spread)

    return [
        entry("same outcome as the fine reference", "same_outcome", "%", SAME_OUTCOME, "higher"),
        entry("difference of the success rates", "rate_difference", "points", RATE_DIFFERENCE, "lower"),
        entry("same outcome in references of 1 and 2 ms", "same_in_references", "%", None, "higher"),
    ]
