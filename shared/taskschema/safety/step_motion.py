"""What the checks know about a step beside its set-points: where hands are meant to end, what they hold."""

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.rotation import rotate
from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair
from taskschema.safety.motion import HeldObject
from taskschema.skills.go_to_pose import pose_to_reach
from taskschema.skills.skill import Skill

ENDS_AT_POINT = ("top_grasp", "side_grasp")
"""Skills whose arguments x and y are where the hand ends, from the object's centre; its height is theirs."""
HOLDS = 0.004
"""A gripper that was closed and stays further open than this holds something, whatever it says itself [m]."""


def hand_goal(
    skill: Skill, values: FloatArray, pose: FloatArray, arm: int, start: FloatArray
) -> FloatArray | None:
    """Return the world x, y [2], or x, y, z [3], at which a skill is meant to leave the hand [m].

    Args:
        skill: of the arm.
        values: [A] its own arguments, SI units.
        pose: [7 + h] the object's at the start of the step.
        arm: 0 left, 1 right.
        start: [7] joint angles that the arm's path starts from [rad].

    """
    if skill.name == "go_to_pose":
        target, _ = pose_to_reach(pose[None, :3], values[None])
        return np.asarray(target[0])
    if skill.name == "lift":
        position, _ = sawyer_pair()[arm].forward(start[None])
        return np.asarray(position[0] + np.array([0.0, 0.0, values[0]]))
    return pose[:2] + values[:2] if skill.name in ENDS_AT_POINT else None


def is_closed(set_point: float) -> bool:
    """Return whether a gripper that was last told to go to an opening [m] was told to close."""
    return bool(set_point <= rethink_gripper().closed)


def is_thick(opening: float) -> bool:
    """Return whether closed fingers that stay open by `opening` [m], as measured, have something between."""
    return bool(opening >= rethink_gripper().closed + HOLDS)


def held_object(size: FloatArray, pose: FloatArray, arm: int, joints: FloatArray) -> HeldObject:
    """Return the object at `pose` [7 + h] in the frame of the hand that holds it.

    Args:
        size: [3] edge lengths of the object's bounding box [m].
        pose: in the world frame.
        arm: 0 left, 1 right.
        joints: [7] measured angles of that arm [rad].

    """
    position, rotation = sawyer_pair()[arm].forward(joints[None])
    inverse = rotation[0].T
    turn = np.stack([rotate(pose[3:7], axis) for axis in np.eye(3)], axis=1)
    return HeldObject(size, inverse @ (pose[:3] - position[0]), inverse @ turn)
