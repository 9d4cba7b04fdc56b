"""Go-to pose: bring the hand to a pose near the object, from the robot's own side."""

from typing import ClassVar

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.euler import roll_pitch_yaw_quaternion
from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.rotation import rotate
from taskschema.motion import ArmPath, PlanningContext
from taskschema.motion.hand_clearance import least_height, tilted_clear
from taskschema.motion.line import joints_along_line
from taskschema.motion.timing import PathLimits, fastest_path
from taskschema.skills.argument import Argument
from taskschema.skills.skill import Skill

APPROACH = 0.16
"""[m] that the hand at least travels at the end, in its final orientation, level, straight from its base."""
CLEARANCE = 0.2
"""[m] from the object's centre towards the base: on the near side of it hands turn and move in the joints."""
NEUTRAL = (-0.45, -1.318, 0.0, 2.525, 0.0, 0.363, 1.27)
"""[rad] joints from which poses are solved: elbow up, wrist in the middle of its range. A solution near them
keeps the elbow off the table; one near the present joints may inherit an elbow that hangs beside it."""
WAYPOINTS = 5
"""Poses on that line, both of its ends among them."""
SPEED = 0.25
"""[m/s] on that line: slow enough that what is touched is pushed and not knocked away."""
ACCELERATION = 1.0
"""[m/s^2]"""
POINTING_DOWN = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
"""Orientation that roll, pitch and yaw turn; three half turns, the middle of the search space, restore it."""


class GoToPose(Skill):
    """Withdraw from the object, turn on the robot's own side of it, then come to the goal in a straight line.

    Its posture at the goal is the one near a neutral posture: the same arguments mean the same posture,
    whatever the arm did before. Roll, pitch and yaw turn a hand that points straight down, which the paper
    leaves open: the middle of the search space is a hand that can touch what stands on the table, not one
    that points at the ceiling. The gripper is symmetric, so of an orientation and its half turn the one
    nearer to that is taken. The hand's position counts before its orientation: one that would be in the table
    is tilted, and only then raised. Something in the way is pushed, or, where it does not give way, pressed
    with the servos' force.
    """

    name: ClassVar[str] = "go_to_pose"
    summary: ClassVar[str] = "bring the hand to a pose near the object and press on what is in the way"
    families: ClassVar[tuple[str, ...]] = ("picking", "rotating")
    arguments: ClassVar[tuple[Argument, ...]] = (
        Argument("x", "m", -0.1, 0.1, "offset from the object's centre along the world's x axis"),
        Argument("y", "m", -0.1, 0.1, "offset from the object's centre along the world's y axis"),
        Argument("z", "m", -0.1, 0.1, "offset from the object's centre along the world's z axis"),
        Argument(
            "roll",
            "rad",
            0.0,
            2.0 * np.pi,
            "turn of a hand pointing down about the world's x axis",
            periodic=True,
        ),
        Argument("pitch", "rad", 0.0, 2.0 * np.pi, "second turn, about the world's y axis", periodic=True),
        Argument("yaw", "rad", 0.0, 2.0 * np.pi, "third turn, about the world's z axis", periodic=True),
    )
    start_state: ClassVar[str] = (
        "Any; the hand withdraws level, and moves in the joints to before its goal, not around obstacles."
    )
    end_state: ClassVar[str] = (
        "End effector at the pose, or held back on its way and pressing, which lift and no-op keep up; "
        "gripper set-point unchanged; arm at rest."
    )
    ends_pressing: ClassVar[bool | None] = True

    def plan(self, context: PlanningContext, arguments: FloatArray) -> ArmPath:
        """Plan from the joints in `context`; see `Skill.plan`."""
        target, rotation = pose_to_reach(context.object_position, arguments)
        neutral = np.tile(NEUTRAL, (len(target), 1))
        rotation = _nearer_half_turn(context, neutral, rotation)
        towards_base = _unit(context.arm.base_position[..., :2] - target[:, :2])
        ahead = _along(target[:, :2] - context.object_position[:, :2], towards_base)
        approach = np.maximum(APPROACH, CLEARANCE - ahead)
        start = target.copy()
        start[:, :2] += towards_base * approach[:, None]
        away = _withdrawn(context, towards_base)
        beside = solve_inverse(context.arm, start, rotation, neutral).joints
        goal = solve_inverse(context.arm, target, rotation, beside).joints
        waypoints = joints_along_line(context.arm, (beside, goal), (start, target), rotation, WAYPOINTS)
        way = np.stack([context.joints, away, beside], axis=1)
        line = np.repeat(approach[:, None] / (WAYPOINTS - 1), WAYPOINTS - 1, axis=1)
        return fastest_path(context.arm, way, context.opening).then(
            fastest_path(
                context.arm,
                waypoints,
                context.opening,
                lengths=line,
                limits=PathLimits(speed=SPEED, acceleration=ACCELERATION),
                grid=6,
            )
        )


def pose_to_reach(object_position: FloatArray, arguments: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the poses of hands, [N, 3] and [N, 3, 3], that arguments [N, 6] mean, clear of the table.

    Args:
        object_position: [N, 3] in the world frame.
        arguments: SI units.

    """
    target = object_position + arguments[:, :3]
    quaternion = roll_pitch_yaw_quaternion(arguments[:, 3:])
    rotation = np.stack([rotate(quaternion, axis) for axis in POINTING_DOWN.T], axis=2)
    rotation = tilted_clear(rotation, target[:, 2])
    target[:, 2] = np.maximum(target[:, 2], least_height(rotation))
    return target, rotation


def _withdrawn(context: PlanningContext, towards_base: FloatArray) -> FloatArray:
    """Return joint angles [N, 7] clear of the object, level back from the present pose if that is not."""
    position, rotation = context.arm.forward(context.joints)
    ahead = _along(position[:, :2] - context.object_position[:, :2], towards_base)
    near = np.flatnonzero(ahead < CLEARANCE)
    joints = context.joints.copy()
    if len(near):
        target = position[near]
        target[:, :2] += towards_base[near] * (CLEARANCE - ahead[near])[:, None]
        joints[near] = solve_inverse(context.arm.rows(near), target, rotation[near], joints[near]).joints
    return joints


def _unit(vector: FloatArray) -> FloatArray:
    """Return level vectors [N, 2] at length 1."""
    return np.asarray(vector / np.sqrt(_along(vector, vector))[:, None])


def _along(vector: FloatArray, direction: FloatArray) -> FloatArray:
    """Return dot products [N] of level vectors [N, 2]."""
    return np.asarray(vector[:, 0] * direction[:, 0] + vector[:, 1] * direction[:, 1])


def _nearer_half_turn(context: PlanningContext, joints: FloatArray, rotation: FloatArray) -> FloatArray:
    """Turn hands [N, 3, 3] half a turn about their own z axis where that is nearer to those of `joints`."""
    _, present = context.arm.forward(joints)
    alike = np.zeros(len(rotation))
    for row in range(3):
        for column in (0, 1):
            alike = alike + rotation[:, row, column] * present[:, row, column]
    return np.where((alike < 0.0)[:, None, None], rotation * np.array([-1.0, -1.0, 1.0]), rotation)
