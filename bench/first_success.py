"""How rare a success is among random arguments: `python -m bench.first_success TASK...`.

Under the paper's schema, with the arguments that policies on states and on images choose from: uniform over
the search spaces, as an audit draws them, and spread as a policy that has learned nothing yet draws them.
Nothing is rendered: neither looks.
"""

import argparse
import os
from collections.abc import Callable
from functools import partial

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.config import NetworkConfig
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.table_arguments import offset_arguments
from taskschema_learner.evaluation import wilson
from taskschema_learner.machine import machine
from taskschema_worker.audit.episodes import BATCH, run_schema
from taskschema_worker.scene_environment import SceneEnvironment

INITIAL_STD = float(np.exp(NetworkConfig().initial_log_std))
"""Of an untrained policy's arguments about the middle of their search spaces, in halves of them."""


def random_on_table(
    initial: bool,
    task: SceneTask,
    rng: np.random.Generator,
    observations: FloatArray,
    step: int,
    part: slice,
) -> FloatArray:
    """Return what skills take [N, A]: uniform locations on the table, other arguments uniform or `initial`.

    An untrained response map is even, so that its locations are uniform in any case.
    """
    pairs = task.image_pairs
    normalised = rng.uniform(-1.0, 1.0, (len(observations), pairs.argument_count))
    if initial:
        spread = INITIAL_STD * rng.standard_normal(normalised.shape)
        located = np.array([name.endswith((".x", ".y")) for name in pairs.argument_names])
        normalised = np.where(located, normalised, spread)
    anchors = task.observation.get(observations, "object.position").astype(np.float64)
    anchors[:, 2] = task.pose_height * task.observation.get(observations, "object.size")[:, 2]
    return offset_arguments(task, pairs.to_si(normalised), anchors)


def random_around_object(
    initial: bool,
    task: SceneTask,
    rng: np.random.Generator,
    observations: FloatArray,
    step: int,
    part: slice,
) -> FloatArray:
    """Return arguments [N, A] of the search spaces of states, uniform or `initial`."""
    shape = (len(observations), task.pairs.argument_count)
    return task.pairs.to_si(
        INITIAL_STD * rng.standard_normal(shape) if initial else rng.uniform(-1.0, 1.0, shape)
    )


SOURCES: dict[str, Callable[..., FloatArray]] = {
    "states": partial(random_around_object, False),
    "images": partial(random_on_table, False),
    "untrained policy on states": partial(random_around_object, True),
    "untrained policy on images": partial(random_on_table, True),
}


def main() -> None:
    """Print a row of Markdown for each task and kind of observation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="+")
    parser.add_argument("--episodes", type=int, default=16 * BATCH)
    parser.add_argument("--only", nargs="+", choices=SOURCES, help="arguments of these kinds alone")
    options = parser.parse_args()
    print(f"On {machine()}.\n\n| task | arguments of | p | 95 % interval | episodes |\n|---|---|---|---|---|")
    for name in options.tasks:
        task = get_task(name)
        assert isinstance(task, SceneTask)
        environment = SceneEnvironment(task, os.cpu_count() or 1)
        keys = [EpisodeKey(0, 0, 0, index) for index in range(options.episodes)]
        instances = [task.draw_instance(generator(key, Purpose.AUDIT)) for key in keys]
        for kind, source in SOURCES.items():
            if options.only is not None and kind not in options.only:
                continue
            rng = generator(EpisodeKey(0, 1, 0, 0), Purpose.AUDIT)
            found = run_schema(environment, task, task.paper_schema, instances, partial(source, task, rng))
            rate = wilson(int(found.success.sum()), options.episodes)
            interval = f"{rate.low:.3%} to {rate.high:.3%}"
            print(f"| {name} | {kind} | {rate.rate:.3%} | {interval} | {options.episodes:,} |", flush=True)
        environment.close()


if __name__ == "__main__":
    main()
