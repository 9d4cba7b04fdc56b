"""Twist: turn the wrist in place."""

from typing import ClassVar

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.motion import ArmPath, PlanningContext
from taskschema.motion.timing import fastest_path
from taskschema.skills.skill import Skill

WRIST = 6
"""The last joint: the end effector lies on its axis."""
ARC = np.deg2rad(150.0)
"""[rad] a quarter turn, and 60 degrees more for what slips in the fingers and gives in the other hand."""


class Twist(Skill):
    """Turn the wrist by 150 degrees the way a right-handed cap opens: counterclockwise, seen from the hand.

    The paper gives neither arc nor direction. A wrist too near its limit turns as far as it can.
    """

    name: ClassVar[str] = "twist"
    summary: ClassVar[str] = "turn the wrist in place by 150 degrees, counterclockwise seen from the hand"
    families: ClassVar[tuple[str, ...]] = ("opening",)
    start_state: ClassVar[str] = "Any; usually the gripper is closed on a cap."
    end_state: ClassVar[str] = (
        "End effector where it was, turned about its fingers; gripper set-point unchanged, at rest."
    )

    def plan(self, context: PlanningContext, arguments: FloatArray) -> ArmPath:
        """Plan a motion of the last joint alone; see `Skill.plan`."""
        turned = context.joints.copy()
        turned[:, WRIST] = np.maximum(turned[:, WRIST] - ARC, context.arm.lower[WRIST])
        return fastest_path(context.arm, np.stack([context.joints, turned], axis=1), context.opening)
