"""The first day's motions: straight in the joints, slow, both hands open."""

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair
from taskschema.motion.timing import fastest_path
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import Motion
from taskschema_robot.errors import RobotError
from taskschema_robot.safety.gated_arms import GatedArms

WRIST = 6
"""The last joint: it turns the hand about its fingers."""


def measured_joints(arms: GatedArms) -> FloatArray:
    """Return where both arms are [2, 7] [rad]."""
    return np.stack([state.positions for state in arms.states()])


def slow_motion(start: FloatArray, end: FloatArray, limits: SafetyLimits) -> Motion:
    """Return a motion of both arms from `start` to `end` [2, 7], at the limits' share of their speed."""
    wide = np.full(1, rethink_gripper().open)
    left, right = (
        fastest_path(kinematics, np.stack([start[row], end[row]])[None], wide)
        for row, kinematics in enumerate(sawyer_pair())
    )
    return Motion.of_paths(left, right, limits.period, speed_ratio=limits.speed_ratio)


def move(arms: GatedArms, motion: Motion) -> None:
    """Make a motion.

    Raises:
        RobotError: if the gate refuses it, or a fault stops it.

    """
    refusal = arms.execute(motion)
    if refusal is not None:
        raise RobotError(f"refused: {refusal.reason}.")
