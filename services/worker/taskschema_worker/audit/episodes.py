"""Episodes that an audit runs: schemas with the expert's, with given, or with random arguments."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from taskschema.arrays import BoolArray, FloatArray
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.task import Schema
from taskschema_worker.scene_environment import SceneEnvironment

BATCH = 256
"""Episodes simulated together."""

ArgumentSource = Callable[[FloatArray, int, slice], FloatArray]
"""Takes observations [n, D], the step and which of the episodes they are; returns SI arguments [n, A]."""


@dataclass(frozen=True)
class Outcome:
    """How some episodes ended."""

    success: BoolArray
    """[N]"""
    closest: FloatArray
    """[N] smallest distance from the goal, 0 for a success."""


def streams(seed: int, part: int, index: int, count: int) -> list[np.random.Generator]:
    """Return the random streams of `count` episodes of one part of an audit."""
    return [generator(EpisodeKey(seed, part, index, episode), Purpose.AUDIT) for episode in range(count)]


def run_schema(
    environment: SceneEnvironment,
    task: SceneTask,
    schema: Schema,
    instances: Sequence[ObjectInstance],
    arguments: ArgumentSource,
) -> Outcome:
    """Run one episode per instance under a fixed schema; an episode ends at its first success."""
    return run_schemas(environment, task, [schema] * len(instances), instances, arguments)


def run_schemas(
    environment: SceneEnvironment,
    task: SceneTask,
    schemas: Sequence[Schema],
    instances: Sequence[ObjectInstance],
    arguments: ArgumentSource,
) -> Outcome:
    """Run one episode per instance, each under its own schema; all schemas have the same length.

    No episode depends on the others in its batch, so many schemas of few episodes may share one.
    """
    success = np.zeros(len(instances), dtype=bool)
    closest = np.zeros(len(instances))
    pairs = np.array([[task.pairs.index(*pair) for pair in schema] for schema in schemas], dtype=np.int64)
    for start in range(0, len(instances), BATCH):
        part = slice(start, min(start + BATCH, len(instances)))
        observations = environment.reset_to(instances[part])
        live = np.arange(part.stop - part.start)
        for step in range(pairs.shape[1]):
            chosen = arguments(observations, step, part)
            result = environment.step(live, pairs[start + live, step], chosen[live])
            success[start + live] = result.success
            observations[live] = result.observations
            live = live[~(result.success | result.diverged)]
            if not len(live):
                break
        closest[part] = environment.closest
    closest[success] = 0.0
    return Outcome(success, closest)


def expert(task: SceneTask) -> ArgumentSource:
    """Return the scripted expert's arguments, whatever the schema."""
    return lambda observations, step, _: task.expert_arguments(observations, step)


def expert_and(task: SceneTask, offsets: FloatArray) -> ArgumentSource:
    """Return the scripted expert's arguments moved by offsets [T, A] or [N, T, A], in half search spaces."""
    space, moved = task.pairs, fixed(offsets)
    return lambda observations, step, part: space.to_si(
        space.to_normalised(task.expert_arguments(observations, step)) + moved(observations, step, part)
    )


def fixed(arguments: FloatArray) -> ArgumentSource:
    """Return given values [T, A], the same in all episodes, or [N, T, A], one row per episode."""
    if arguments.ndim == 2:
        return lambda observations, step, _: np.repeat(arguments[None, step], len(observations), axis=0)
    return lambda _, step, part: arguments[part, step]
