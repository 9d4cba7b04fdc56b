"""How rare a success is among random arguments: `python -m bench.image_search TASK...`.

Under the paper's schema, with the arguments that policies on states and on images choose from. Nothing is
rendered: random arguments do not look.
"""

import argparse
import os
from collections.abc import Callable
from functools import partial

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.table_arguments import offset_arguments
from taskschema_learner.evaluation import wilson
from taskschema_learner.machine import machine
from taskschema_worker.audit.episodes import BATCH, run_schema
from taskschema_worker.scene_environment import SceneEnvironment


def random_on_table(
    task: SceneTask, rng: np.random.Generator, observations: FloatArray, step: int, part: slice
) -> FloatArray:
    """Return what skills take, for uniform locations on the table and uniform other arguments [N, A]."""
    normalised = rng.uniform(-1.0, 1.0, (len(observations), task.image_pairs.argument_count))
    anchors = task.observation.get(observations, "object.position").astype(np.float64)
    anchors[:, 2] = task.pose_height * task.observation.get(observations, "object.size")[:, 2]
    return offset_arguments(task, task.image_pairs.to_si(normalised), anchors)


def random_around_object(
    task: SceneTask, rng: np.random.Generator, observations: FloatArray, step: int, part: slice
) -> FloatArray:
    """Return uniform arguments [N, A] of the search spaces of states."""
    return task.pairs.to_si(rng.uniform(-1.0, 1.0, (len(observations), task.pairs.argument_count)))


SOURCES: dict[str, Callable[..., FloatArray]] = {"states": random_around_object, "images": random_on_table}


def main() -> None:
    """Print a row of Markdown for each task and kind of observation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="+")
    parser.add_argument("--episodes", type=int, default=16 * BATCH)
    parser.add_argument("--only", choices=SOURCES, help="arguments of one kind alone")
    options = parser.parse_args()
    print(f"On {machine()}.\n\n| task | arguments of | p | 95 % interval | episodes |\n|---|---|---|---|---|")
    for name in options.tasks:
        task = get_task(name)
        assert isinstance(task, SceneTask)
        environment = SceneEnvironment(task, os.cpu_count() or 1)
        keys = [EpisodeKey(0, 0, 0, index) for index in range(options.episodes)]
        instances = [task.draw_instance(generator(key, Purpose.AUDIT)) for key in keys]
        for kind, source in SOURCES.items():
            if options.only not in (None, kind):
                continue
            rng = generator(EpisodeKey(0, 1, 0, 0), Purpose.AUDIT)
            found = run_schema(environment, task, task.paper_schema, instances, partial(source, task, rng))
            rate = wilson(int(found.success.sum()), options.episodes)
            interval = f"{rate.low:.3%} to {rate.high:.3%}"
            print(f"| {name} | {kind} | {rate.rate:.3%} | {interval} | {options.episodes:,} |", flush=True)
        environment.close()


if __name__ == "__main__":
    main()
