"""Row 1: simulated seconds per wall second and core, against robosuite's own `env.step`.

Both run the expert's grasp and lift of the same bar on one thread: robosuite one episode at a time through
`env.step` at its default 20 Hz, its joint position controllers following the same set-points; the
vectorised simulation a batch of them, planning and observations included.
"""

import time

import numpy as np

from bench.entry import Entry
from bench.robosuite_scene import CONTROL_RATE, BarLift, action
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_worker.scene_environment import SceneEnvironment

EPISODES = 168
"""Episodes of a batch: a worker's share of the default round of 200, rounded to whole slots."""
SEED = 0
TARGET = 40.0
"""Times robosuite's speed, at least; 80 is aimed at."""


def measure(repeats: int) -> list[Entry]:
    task = LateralLifting()
    environment = SceneEnvironment(task, threads=1)
    joints, openings = recorded_motion(task, environment)
    instance = task.draw_instance(np.random.default_rng(SEED))
    lite, full = (BarLift(instance, task.home_joints, lite_physics=lite) for lite in (True, False))
    samples: dict[str, list[float]] = {"own": [], "lite": [], "full": [], "ratio": [], "ratio_full": []}
    for _ in range(repeats):
        samples["own"].append(own_speed(task, environment))
        samples["lite"].append(robosuite_speed(lite, joints, openings))
        samples["full"].append(robosuite_speed(full, joints, openings))
        samples["ratio"].append(samples["own"][-1] / samples["lite"][-1])
        samples["ratio_full"].append(samples["own"][-1] / samples["full"][-1])
    environment.close()
    unit = "simulated s/s"
    return [
        Entry.of(
            1,
            "simulation against robosuite's env.step, lite physics",
            samples["ratio"],
            "x",
            TARGET,
            "higher",
        ),
        Entry.of(1, "the same without lite physics", samples["ratio_full"], "x", None, "higher"),
        Entry.of(1, "vectorised simulation, one core", samples["own"], unit, None, "higher"),
        Entry.of(1, "robosuite, lite physics, one core", samples["lite"], unit, None, "higher"),
        Entry.of(1, "robosuite, without lite physics, one core", samples["full"], unit, None, "higher"),
    ]


def recorded_motion(task: LateralLifting, environment: SceneEnvironment) -> tuple[np.ndarray, np.ndarray]:
    """Return the expert's joint [S, 2, 7] and gripper set-points [S, 2] at robosuite's control rate."""
    observations = environment.reset([np.random.default_rng(SEED)])
    row = np.array([0])
    joints, openings = [], []
    for step, pair in enumerate(task.paper_pairs):
        arguments = task.expert_arguments(observations, step)
        paths = environment.plan(row, np.array([pair]), arguments)
        times = np.arange(1, round(paths.duration.max() * CONTROL_RATE) + 1) / CONTROL_RATE
        both_joints, _, both_openings = paths.sample(times)
        joints.append(np.swapaxes(both_joints, 0, 1))
        openings.append(both_openings.T)
        observations = environment.step(row, np.array([pair]), arguments).observations
    return np.concatenate(joints), np.concatenate(openings)


def own_speed(task: LateralLifting, environment: SceneEnvironment) -> float:
    """Return simulated seconds per wall second of a batch of expert episodes, resets included."""
    start, steps = time.perf_counter(), 0
    observations = environment.reset([np.random.default_rng(SEED + index) for index in range(EPISODES)])
    live = np.arange(EPISODES)
    for step, pair in enumerate(task.paper_pairs):
        arguments = task.expert_arguments(observations, step)
        result = environment.step(live, np.full(EPISODES, pair), arguments)
        observations = result.observations
        steps += int(result.physics_steps.sum())
    return steps * environment.timestep / (time.perf_counter() - start)


def robosuite_speed(scene: BarLift, joints: np.ndarray, openings: np.ndarray) -> float:
    """Return simulated seconds per wall second of `env.step` along the motion, the reset left out."""
    scene.reset()
    start = time.perf_counter()
    for points, opening in zip(joints, openings, strict=True):
        scene.step(action(points, opening))
    seconds = time.perf_counter() - start
    # The motion was really carried out: its controllers lag, but the arms end near the last set-point.
    assert np.abs(scene.arm_joints() - joints[-1]).max() < 0.3
    return len(joints) / CONTROL_RATE / seconds
