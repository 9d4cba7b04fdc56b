"""Search for arguments that solve a schema: the cross-entropy method (Rubinstein 1999)."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.task import Schema
from taskschema_worker.audit.episodes import ArgumentSource, expert_and, fixed, run_schema, streams
from taskschema_worker.scene_environment import SceneEnvironment

ELITE_SHARE = 0.1
"""Share of a population that the next one is fitted to."""
SMALLEST_SPREAD = 0.02
"""Standard deviation, in units of half a search space, that a population keeps."""
SMOOTHING = 0.7
"""Weight of the new mean and spread against the old."""


@dataclass(frozen=True)
class Search:
    """Size of a search."""

    population: int
    iterations: int
    trials: int
    """Fresh instances that the arguments found are tested on."""


@dataclass(frozen=True)
class Found:
    """How often the best arguments of a search solve fresh instances."""

    successes: int
    trials: int
    training_successes: int
    """Successes while searching, among all populations."""


def search_arguments(
    environment: SceneEnvironment,
    task: SceneTask,
    schema: Schema,
    seed: int,
    index: int,
    size: Search,
    near_expert: float | None = None,
) -> Found:
    """Search the arguments of one schema, the same for every instance: they are relative to the object.

    Every member of a population meets another random instance. Members are ranked by success, then by how
    near to the goal they came.

    Args:
        environment: that measures the distance from the goal.
        task: whose instances these are.
        schema: under which all episodes run.
        seed: of the search.
        index: of the search among those of an audit.
        size: of the search.
        near_expert: what is searched is added to the scripted expert's arguments, and the first population
            has this standard deviation, in units of half a search space; None: it is uniform over them.

    """
    space = task.pairs
    rng, *_ = streams(seed, 100, index, 1)
    shape = (size.population, len(schema), space.argument_count)
    raw: FloatArray
    raw = rng.uniform(-1, 1, shape) if near_expert is None else near_expert * rng.standard_normal(shape)

    def source(offsets: FloatArray) -> ArgumentSource:
        return fixed(space.to_si(offsets)) if near_expert is None else expert_and(task, offsets)

    mean, spread = np.zeros(shape[1:]), np.ones(shape[1:])
    best, best_score, hits = mean, np.inf, 0
    elite_count = max(2, round(ELITE_SHARE * size.population))
    for iteration in range(size.iterations):
        instances = [task.draw_instance(g) for g in streams(seed, 101 + iteration, index, size.population)]
        outcome = run_schema(environment, task, schema, instances, source(raw))
        hits += int(outcome.success.sum())
        order = np.argsort(outcome.closest, kind="stable")
        elite = raw[order[:elite_count]]
        score = float(outcome.closest[order[:elite_count]].mean())
        new_mean, new_spread = elite.mean(axis=0), elite.std(axis=0)
        weight = 1.0 if iteration == 0 else SMOOTHING
        mean = weight * new_mean + (1.0 - weight) * mean
        spread = np.maximum(weight * new_spread + (1.0 - weight) * spread, SMALLEST_SPREAD)
        if score < best_score:
            best, best_score = mean, score
        raw = mean + spread * rng.standard_normal(shape)
    instances = [task.draw_instance(g) for g in streams(seed, 99, index, size.trials)]
    tested = run_schema(environment, task, schema, instances, source(best))
    return Found(int(tested.success.sum()), size.trials, hits)
