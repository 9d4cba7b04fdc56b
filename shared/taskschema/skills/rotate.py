"""Rotate: move the hand on a circle about a vertical axis."""

from typing import ClassVar

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.inverse import solve_inverse
from taskschema.motion import ArmPath, PlanningContext
from taskschema.motion.timing import PathLimits, fastest_path
from taskschema.skills.argument import Argument
from taskschema.skills.skill import Skill

ARC = 2.0 * np.pi
"""[rad] a full turn: wherever the hand begins, it meets an arm of a T-handle and carries it half a turn."""
WAYPOINTS = 13
"""Poses on the circle, its first and last among them."""
SPEED = 0.4
"""[m/s] along the circle."""
ACCELERATION = 1.5
"""[m/s^2]"""


class Rotate(Skill):
    """Move the end effector level to the nearest point of a circle, then once around it, orientation kept.

    Counterclockwise, seen from above: the paper gives neither arc nor direction.
    """

    name: ClassVar[str] = "rotate"
    summary: ClassVar[str] = "move once around a vertical axis, counterclockwise seen from above"
    families: ClassVar[tuple[str, ...]] = ("rotating",)
    arguments: ClassVar[tuple[Argument, ...]] = (
        Argument("x", "m", -0.1, 0.1, "offset of the axis from the object's centre along the world's x axis"),
        Argument("y", "m", -0.1, 0.1, "offset of the axis from the object's centre along the world's y axis"),
        Argument("radius", "m", 0.0, 0.2, "of the circle that the end effector moves on"),
    )
    start_state: ClassVar[str] = "Any; usually the hand is beside what it is to push around."
    end_state: ClassVar[str] = (
        "End effector where it came onto the circle, height, orientation and gripper set-point unchanged, "
        "at rest."
    )

    def plan(self, context: PlanningContext, arguments: FloatArray) -> ArmPath:
        """Plan from the measured pose; see `Skill.plan`."""
        position, rotation = context.arm.forward(context.joints)
        axis = context.object_position[:, :2] + arguments[:, :2]
        start = np.arctan2(position[:, 1] - axis[:, 1], position[:, 0] - axis[:, 0])
        radius = arguments[:, 2]
        targets = []
        for angle in np.linspace(0.0, ARC, WAYPOINTS):
            target = position.copy()
            target[:, 0] = axis[:, 0] + radius * np.cos(start + angle)
            target[:, 1] = axis[:, 1] + radius * np.sin(start + angle)
            targets.append(target)
        waypoints = [context.joints]
        for target in (0.5 * (position + targets[0]), *targets):
            waypoints.append(solve_inverse(context.arm, target, rotation, waypoints[-1]).joints)
        way = np.stack(waypoints[:3], axis=1)
        path = fastest_path(context.arm, way, context.opening)
        chord = radius * ARC / (WAYPOINTS - 1)
        return path.then(
            fastest_path(
                context.arm,
                np.stack(waypoints[2:], axis=1),
                context.opening,
                lengths=np.repeat(chord[:, None], WAYPOINTS - 1, axis=1),
                limits=PathLimits(speed=SPEED, acceleration=ACCELERATION),
                grid=6,
            )
        )
