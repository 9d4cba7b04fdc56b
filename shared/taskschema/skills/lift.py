"""Lift: straight up by a distance."""

from typing import ClassVar

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.inverse import solve_inverse
from taskschema.motion import ArmPath, PlanningContext
from taskschema.motion.line import joints_along_line
from taskschema.motion.timing import PathLimits, fastest_path
from taskschema.skills.argument import Argument
from taskschema.skills.skill import Skill

ACCELERATION = 1.5
"""[m/s^2]"""
WAYPOINTS = 6
"""Poses on the vertical line that the joint path passes through, the start among them."""


class Lift(Skill):
    """Raise the end effector vertically, keeping its orientation."""

    name: ClassVar[str] = "lift"
    summary: ClassVar[str] = "raise the end effector straight up by a distance"
    families: ClassVar[tuple[str, ...]] = ("lateral_lifting", "picking")
    arguments: ClassVar[tuple[Argument, ...]] = (
        Argument("distance", "m", 0.0, 0.5, "how far the end effector rises, along the world's z axis"),
    )
    start_state: ClassVar[str] = "Any; usually the gripper is closed on the object."
    end_state: ClassVar[str] = (
        "End effector `distance` higher, orientation and gripper set-point unchanged, at rest."
    )
    ends_pressing: ClassVar[bool | None] = None

    def plan(self, context: PlanningContext, arguments: FloatArray) -> ArmPath:
        """Plan straight up from the joints in `context`; see `Skill.plan`."""
        distance = arguments[:, 0]
        position, rotation = context.arm.forward(context.joints)
        target = position.copy()
        target[:, 2] += distance
        top = solve_inverse(context.arm, target, rotation, context.joints).joints
        waypoints = joints_along_line(
            context.arm, (context.joints, top), (position, target), rotation, WAYPOINTS
        )
        lengths = np.repeat(distance[:, None] / (WAYPOINTS - 1), WAYPOINTS - 1, axis=1)
        return fastest_path(
            context.arm,
            waypoints,
            context.opening,
            lengths=lengths,
            limits=PathLimits(speed=context.lift_speed, acceleration=ACCELERATION),
            grid=6,
        )
