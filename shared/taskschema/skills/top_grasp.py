"""Top grasp: come down on the object from above and close the gripper."""

from typing import ClassVar

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.rotation import vertical_turn
from taskschema.motion import ArmPath, PlanningContext
from taskschema.motion.timing import fastest_path
from taskschema.skills.argument import Argument
from taskschema.skills.skill import Skill

POINTING_DOWN = np.diag([1.0, -1.0, -1.0])
"""End effector's orientation with its fingers pointing down, closing along the world's x axis."""
CLEARANCE = 0.02
"""[m] between the finger tips and the object's top before the hand comes down."""
TABLE_MARGIN = 0.006
"""[m] that the finger tips keep above the table."""
OPEN_SECONDS = 0.15
"""[s] for the fingers to open, where they are not open already."""
CLOSE_SECONDS = 0.2
"""[s] for the fingers to close."""
WRIST = 6
"""The last joint; with the hand pointing down it turns the gripper the other way about the vertical."""
WRIST_MARGIN = 0.3
"""[rad] to its limits within which the wrist turns the other way."""


class TopGrasp(Skill):
    """Open, move above a point near the object, come down with the fingers around it, close.

    The grasp's height is the skill's own: where the object is to be taken from above (its centre, a bottle's
    cap), or as low as the table lets the finger tips go. The gripper is symmetric, so of an orientation and
    its half turn the nearer one is taken.
    """

    name: ClassVar[str] = "top_grasp"
    summary: ClassVar[str] = "come down from above at a point near the object, close the gripper"
    families: ClassVar[tuple[str, ...]] = ("lateral_lifting", "picking", "opening")
    arguments: ClassVar[tuple[Argument, ...]] = (
        Argument("x", "m", -0.1, 0.1, "offset from the object's centre along the world's x axis"),
        Argument("y", "m", -0.1, 0.1, "offset from the object's centre along the world's y axis"),
        Argument(
            "z_orientation",
            "rad",
            0.0,
            2.0 * np.pi,
            "turn of the gripper about the world's z axis; at 0 and pi the fingers close along x",
            periodic=True,
        ),
    )
    start_state: ClassVar[str] = (
        "Any; a closed gripper opens first, and a low hand rises before it moves sideways."
    )
    end_state: ClassVar[str] = "Fingers at the point, pointing down, closed with full force; arm at rest."

    def plan(self, context: PlanningContext, arguments: FloatArray) -> ArmPath:
        """Plan from the measured joints; see `Skill.plan`."""
        wide = np.full(len(arguments), context.gripper.open)
        half_height = _half_height(context.object_size, context.object_quaternion)
        top = context.object_position[:, 2] + half_height + CLEARANCE + context.gripper.fingertip
        raised = _raised(context, top)
        closed_now = context.opening < context.gripper.open
        path = ArmPath.stay(context.joints, context.opening).then_grip(
            wide, np.where(closed_now, OPEN_SECONDS, 0.0)
        )
        path = path.then(fastest_path(context.arm, np.stack([context.joints, raised], axis=1), wide))
        above = context.object_position.copy()
        above[:, :2] += arguments[:, :2]
        grasp = above.copy()
        above[:, 2] = top
        grasp[:, 2] = np.maximum(context.top_grasp_height, TABLE_MARGIN + context.gripper.fingertip)
        seed = raised.copy()
        turn = _nearest_turn(context, arguments[:, 2])
        seed[:, WRIST] -= turn
        rotation = vertical_turn(_closing_angle(context) + turn) @ POINTING_DOWN
        over = solve_inverse(context.arm, above, rotation, seed).joints
        down = solve_inverse(context.arm, grasp, rotation, over).joints
        path = path.then(fastest_path(context.arm, np.stack([raised, over, down], axis=1), wide))
        shut = np.full(len(arguments), context.gripper.closed)
        return path.then_grip(shut, np.full(len(arguments), CLOSE_SECONDS))


def _half_height(size: FloatArray, quaternion: FloatArray) -> FloatArray:
    """Return how far the object's box reaches above its centre [N], in metres."""
    w, x, y, z = quaternion[:, 0], quaternion[:, 1], quaternion[:, 2], quaternion[:, 3]
    shares = (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    half = np.abs(shares[0]) * size[:, 0] + np.abs(shares[1]) * size[:, 1] + np.abs(shares[2]) * size[:, 2]
    return np.asarray(0.5 * half)


def _raised(context: PlanningContext, height: FloatArray) -> FloatArray:
    """Return joint angles [N, 7] straight above the present pose at `height`; the present ones if higher."""
    position, rotation = context.arm.forward(context.joints)
    low = np.flatnonzero(position[:, 2] < height)
    joints = context.joints.copy()
    if len(low):
        target = position[low]
        target[:, 2] = height[low]
        joints[low] = solve_inverse(context.arm.rows(low), target, rotation[low], joints[low]).joints
    return joints


def _closing_angle(context: PlanningContext) -> FloatArray:
    """Return the present angle [N] of the closing axis about the world's z axis."""
    _, rotation = context.arm.forward(context.joints)
    return np.arctan2(rotation[:, 1, 0].copy(), rotation[:, 0, 0].copy())


def _nearest_turn(context: PlanningContext, orientation: FloatArray) -> FloatArray:
    """Return the turn [N] to `orientation` or its half turn: the nearer one that the wrist can do."""
    ahead = orientation - _closing_angle(context)
    turn = ahead - np.pi * np.round(ahead / np.pi)
    wrist = context.joints[:, WRIST] - turn
    turn = np.where(wrist > context.arm.upper[WRIST] - WRIST_MARGIN, turn + np.pi, turn)
    return np.asarray(np.where(wrist < context.arm.lower[WRIST] + WRIST_MARGIN, turn - np.pi, turn))
