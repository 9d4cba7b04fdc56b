"""Motions for tests of the gate: planned by the skills themselves, or straight in joint space."""

import numpy as np

from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair, sawyers
from taskschema.motion import PlanningContext
from taskschema.motion.timing import fastest_path
from taskschema.safety.motion import Motion
from taskschema.skills.registry import get_skill
from taskschema.tasks import get_task

PERIOD = 0.01
BAR = get_task("lateral-lifting")


def straight(start: np.ndarray, end: np.ndarray, speed_ratio: float = 1.0) -> Motion:
    """Both arms straight from `start` to `end` [2, 7]."""
    wide = np.array([rethink_gripper().open])
    paths = [
        fastest_path(kinematics, np.stack([first, last])[None], wide)
        for kinematics, first, last in zip(sawyer_pair(), start, end, strict=True)
    ]
    return Motion.of_paths(*paths, PERIOD, speed_ratio=speed_ratio)


def context(arm: int, joints: np.ndarray, opening: float, task=BAR, instance=None) -> PlanningContext:
    instance = instance or task.draw_instance(np.random.default_rng(0))
    size = np.array([task.object_size]) * instance.scale
    return PlanningContext(
        arm=sawyers(np.array([arm])),
        gripper=rethink_gripper(),
        joints=joints[None],
        opening=np.array([opening]),
        object_position=np.array([instance.position]),
        object_quaternion=np.array([instance.quaternion]),
        object_size=size,
        top_grasp_offset=task.top_grasp_height * size[:, 2],
        side_grasp_offset=task.side_grasp_height * size[:, 2],
        lift_speed=task.lift_speed,
    )


def skill_motion(joints, names, arguments, *, task=BAR, instance=None, opening=None, speed_ratio=1.0):
    """The motion of one skill for each arm from `joints` [2, 7]; arguments are one array for each arm."""
    opening = opening or rethink_gripper().open
    paths = [
        get_skill(name).plan(
            context(arm, joints[arm], opening, task, instance), np.array([values], dtype=float)
        )
        for arm, (name, values) in enumerate(zip(names, arguments, strict=True))
    ]
    return Motion.of_paths(*paths, PERIOD, speed_ratio=speed_ratio)


def grasp_of_the_bar(joints=BAR.home_joints):
    """The paper's first step of lateral lifting, with arguments that work."""
    along = 0.09
    return skill_motion(
        joints,
        ("top_grasp", "top_grasp"),
        ([-along, -along, 0.75 * np.pi], [along, along, 0.75 * np.pi]),
    )
