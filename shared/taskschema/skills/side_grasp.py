"""Side grasp: come at the object horizontally and close the gripper."""

from typing import ClassVar

import numpy as np

from taskschema.arrays import BoolArray, FloatArray
from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.rotation import vertical_turn
from taskschema.motion import ArmPath, PlanningContext
from taskschema.motion.timing import fastest_path
from taskschema.skills.argument import Argument
from taskschema.skills.skill import Skill

POINTING_FORWARD = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""End effector's orientation with its fingers pointing along the x axis, closing along the y axis."""
STANDOFF = 0.12
"""[m] from the point, against the approach direction, to where the straight approach begins."""
RETREAT = 0.1
"""[m] that a closed hand backs off along its fingers, after opening, before it moves on."""
TABLE_MARGIN = 0.06
"""[m] lowest height of the end effector: the hand and the wrist behind it are wide."""
OPEN_SECONDS = 0.15
"""[s] for the fingers to open, where they are not open already."""
CLOSE_SECONDS = 0.2
"""[s] for the fingers to close."""
ELBOW_RIGHT = (-1.37, -0.09, 0.97, 1.99, -1.84, -0.58, -1.32)
"""Joint angles [rad] with level fingers and the elbow at the robot's right: for approaches to its left.

An elbow above the object would be in the other arm's way."""
ELBOW_LEFT = (0.79, 0.15, -0.5, 1.39, -1.56, 1.08, 1.73)
"""The same with the elbow at the robot's left: for approaches to its right."""


class SideGrasp(Skill):
    """Open, back off, move to a standoff beside the object, come straight in with level fingers, close.

    The grasp's height is the skill's own: where the object is to be taken from the side (its centre, a
    corkscrew's base), or as low as the table lets the hand go.
    """

    name: ClassVar[str] = "side_grasp"
    summary: ClassVar[str] = "come in level at a point near the object, close the gripper"
    families: ClassVar[tuple[str, ...]] = ("opening", "rotating")
    arguments: ClassVar[tuple[Argument, ...]] = (
        Argument("x", "m", -0.1, 0.1, "offset from the object's centre along the world's x axis"),
        Argument("y", "m", -0.1, 0.1, "offset from the object's centre along the world's y axis"),
        Argument(
            "approach_angle",
            "rad",
            -0.5 * np.pi,
            0.5 * np.pi,
            "direction that the fingers point in, about the world's z axis; 0 is straight ahead of the robot",
        ),
    )
    start_state: ClassVar[str] = "Any; a closed gripper opens and backs off first."
    end_state: ClassVar[str] = "Fingers around the point, level, closed with full force; arm at rest."

    def plan(self, context: PlanningContext, arguments: FloatArray) -> ArmPath:
        """Plan from the measured joints; see `Skill.plan`."""
        wide = np.full(len(arguments), context.gripper.open)
        closed_now = context.opening < context.gripper.open
        back = _backed_off(context, closed_now)
        path = ArmPath.stay(context.joints, context.opening).then_grip(
            wide, np.where(closed_now, OPEN_SECONDS, 0.0)
        )
        path = path.then(fastest_path(context.arm, np.stack([context.joints, back], axis=1), wide))
        point = context.object_position.copy()
        point[:, :2] += arguments[:, :2]
        point[:, 2] = np.maximum(context.side_grasp_height, TABLE_MARGIN)
        forward = context.arm.base_rotation[..., 0]
        heading = np.arctan2(forward[..., 1], forward[..., 0]) + arguments[:, 2]
        rotation = vertical_turn(heading) @ POINTING_FORWARD
        joints = np.where(arguments[:, 2:] < 0.0, np.array(ELBOW_LEFT), np.array(ELBOW_RIGHT))
        waypoints = [back]
        for distance in (STANDOFF, 0.5 * STANDOFF, 0.0):
            joints = solve_inverse(context.arm, point - distance * rotation[:, :, 2], rotation, joints).joints
            waypoints.append(joints)
        path = path.then(fastest_path(context.arm, np.stack(waypoints, axis=1), wide))
        shut = np.full(len(arguments), context.gripper.closed)
        return path.then_grip(shut, np.full(len(arguments), CLOSE_SECONDS))


def _backed_off(context: PlanningContext, closed: BoolArray) -> FloatArray:
    """Return joint angles [N, 7] of closed hands backed off along their fingers, of open ones as they are."""
    rows = np.flatnonzero(closed)
    joints = context.joints.copy()
    if len(rows):
        arm = context.arm.rows(rows)
        position, rotation = arm.forward(joints[rows])
        target = position - RETREAT * rotation[:, :, 2]
        joints[rows] = solve_inverse(arm, target, rotation, joints[rows]).joints
    return joints
