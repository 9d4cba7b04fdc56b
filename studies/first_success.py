"""How rare a success is among random arguments: `python -m studies.first_success TASK|SCHEMA.json...`.

Under the paper's schema of a task, or one that was exported, with the arguments that policies on states and
on images choose from: uniform over the search spaces, as an audit draws them, and spread as a policy that has
learned nothing yet draws them. Nothing is rendered: neither looks.
"""

import argparse
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.config import NetworkConfig
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.table_arguments import offset_arguments
from taskschema.tasks.task import Schema
from taskschema_learner.evaluation import wilson
from taskschema_learner.machine import machine
from taskschema_learner.schemas.schema_file import read_schema
from taskschema_worker.audit.episodes import BATCH, run_schema
from taskschema_worker.scene_environment import SceneEnvironment

INITIAL_STD = float(np.exp(NetworkConfig().initial_log_std))
"""Of an untrained policy's arguments about the middle of their search spaces, in halves of them."""


@dataclass(frozen=True)
class RandomArguments:
    """A source of random arguments, new ones for every episode and step; see `run_schema`."""

    task: SceneTask
    rng: np.random.Generator
    on_table: bool
    """Locations on the table, as on images, and not around the object, as on states."""
    initial: bool
    """As an untrained policy draws them, and not uniformly. Its response map is even: so are locations."""

    def __call__(self, observations: FloatArray, step: int, part: slice) -> FloatArray:
        """Return what skills take [N, A]."""
        pairs = self.task.image_pairs if self.on_table else self.task.pairs
        normalised = self.rng.uniform(-1.0, 1.0, (len(observations), pairs.argument_count))
        if self.initial:
            spread = INITIAL_STD * self.rng.standard_normal(normalised.shape)
            even = [self.on_table and name.endswith((".x", ".y")) for name in pairs.argument_names]
            normalised = np.where(even, normalised, spread)
        arguments = pairs.to_si(normalised)
        if not self.on_table:
            return arguments
        return offset_arguments(self.task, arguments, anchors_of(self.task, observations))


def anchors_of(task: SceneTask, observations: FloatArray) -> FloatArray:
    """Return [N, 3] what offsets are counted from: the object's place, and the height of poses."""
    anchors = task.observation.get(observations, "object.position").astype(np.float64)
    anchors[:, 2] = task.pose_height * task.observation.get(observations, "object.size")[:, 2]
    return anchors


KINDS = {
    "states": (False, False),
    "images": (True, False),
    "untrained policy on states": (False, True),
    "untrained policy on images": (True, True),
}


def main() -> None:
    """Print a row of Markdown for each task and kind of observation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="+", metavar="TASK|SCHEMA.json")
    parser.add_argument("--episodes", type=int, default=16 * BATCH)
    parser.add_argument("--only", nargs="+", choices=KINDS, help="arguments of these kinds alone")
    options = parser.parse_args()
    print(
        f"On {machine()}.\n\n| schema | arguments of | p | 95 % interval | episodes |\n|---|---|---|---|---|"
    )
    for name in options.tasks:
        task, schema = _task_and_schema(name)
        environment = SceneEnvironment(task, os.cpu_count() or 1)
        keys = [EpisodeKey(0, 0, 0, index) for index in range(options.episodes)]
        instances = [task.draw_instance(generator(key, Purpose.AUDIT)) for key in keys]
        for kind, (on_table, initial) in KINDS.items():
            if options.only is not None and kind not in options.only:
                continue
            rng = generator(EpisodeKey(0, 1, 0, 0), Purpose.AUDIT)
            source = RandomArguments(task, rng, on_table, initial)
            found = run_schema(environment, task, schema, instances, source)
            rate = wilson(int(found.success.sum()), options.episodes)
            interval = f"{rate.low:.3%} to {rate.high:.3%}"
            print(f"| {name} | {kind} | {rate.rate:.3%} | {interval} | {options.episodes:,} |", flush=True)
        environment.close()


def _task_and_schema(name: str) -> tuple[SceneTask, Schema]:
    """Return a task with the paper's schema, or what a schema's file names."""
    document = read_schema(Path(name)) if name.endswith(".json") else None
    task = get_task(name if document is None else document.task)
    assert isinstance(task, SceneTask)
    if document is None:
        return task, task.paper_schema
    return task, tuple((pair.left, pair.right) for pair in document.best)


if __name__ == "__main__":
    main()
