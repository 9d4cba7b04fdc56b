"""Row 10: reset of an episode, against robosuite's hard reset of two Sawyers with an object."""

import contextlib
import io
import logging
import time

import numpy as np

from bench.entry import Entry
from bench.service_process import TASK
from taskschema.tasks.registry import get_task
from taskschema_worker.environments import make_environment

EPISODES = 100
"""Reset together, as a worker does with half a round."""


def measure(repeats: int) -> list[Entry]:
    task = get_task(TASK)
    environment, robosuite = make_environment(task), _robosuite_environment()
    ours, theirs = [], []
    environment.reset([np.random.default_rng(index) for index in range(EPISODES)])  # copies its models once
    for repeat in range(repeats):
        generators = [np.random.default_rng((repeat, index)) for index in range(EPISODES)]
        started = time.thread_time()
        environment.reset(generators)
        ours.append(1e3 * (time.thread_time() - started) / EPISODES)
        started = time.thread_time()
        robosuite.reset()
        theirs.append(1e3 * (time.thread_time() - started))
    environment.close()
    robosuite.close()
    return [
        Entry.of(10, "reset of an episode", ours, "ms", 1, "lower"),
        Entry.of(10, "robosuite's hard reset of TwoArmLift", theirs, "ms", None, "lower"),
    ]


def _robosuite_environment():
    logging.getLogger("robosuite_logs").setLevel(logging.CRITICAL)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        import robosuite
    return robosuite.make(
        "TwoArmLift",
        robots=["Sawyer", "Sawyer"],
        env_configuration="opposed",
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        hard_reset=True,
    )
