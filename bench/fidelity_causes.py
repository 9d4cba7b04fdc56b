"""What in the shipped physics leads to other outcomes: `python -m bench.fidelity_causes TASK`.

The perturbed expert's episodes on physics between the two, each told by its step and by what may touch what.
"""

import argparse
import os

import numpy as np

from bench.fidelity import BLOCK
from bench.reference_physics import PERTURBATION, TIMESTEP, perturbed_outcomes, reference_model
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema_learner.machine import machine

BETWEEN = ((0.008, True), (0.008, False), (0.004, False), (0.002, False))
"""Steps [s], and whether every body collides with every other: solver as tight as the reference's."""


def main() -> None:
    """Print a row of a table for each physics."""
    parser = argparse.ArgumentParser(prog="python -m bench.fidelity_causes", description=__doc__)
    parser.add_argument("task", choices=PERTURBATION)
    parser.add_argument("--episodes", type=int, default=BLOCK)
    options = parser.parse_args()
    task, episodes = get_task(options.task), range(options.episodes)
    assert isinstance(task, SceneTask)
    threads = len(os.sched_getaffinity(0))
    reference = perturbed_outcomes(task, reference_model(task), episodes, threads)
    print(
        f"{machine()}\n\n| physics of {task.name} | succeed | same outcome as the reference |\n|---|---|---|"
    )
    print(f"| reference, {1e3 * TIMESTEP:g} ms | {reference.mean():.1%} | |", flush=True)
    for timestep, every_body in BETWEEN:
        model = reference_model(task, timestep, every_body=every_body)
        outcomes = perturbed_outcomes(task, model, episodes, threads)
        touching = "every body collides" if every_body else "what may touch what as shipped"
        alike = np.mean(outcomes == reference)
        print(f"| {1e3 * timestep:g} ms, {touching} | {outcomes.mean():.1%} | {alike:.1%} |", flush=True)


if __name__ == "__main__":
    main()
