"""Joint angles along a straight line of the end effector."""

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.arm import ArmKinematics
from taskschema.kinematics.inverse import solve_inverse


def joints_along_line(
    arm: ArmKinematics,
    ends: tuple[FloatArray, FloatArray],
    positions: tuple[FloatArray, FloatArray],
    rotation: FloatArray,
    poses: int,
) -> FloatArray:
    """Return joint angles [N, poses, 7] at evenly spaced poses on a line, both of its ends among them.

    The poses between are solved all at once, each from its share of the way between the ends' joints.

    Args:
        arm: the arm, or those of the rows.
        ends: [N, 7] joint angles at either end [rad].
        positions: [N, 3] of the end effector at either end, world frame [m].
        rotation: [N, 3, 3] of the end effector throughout, world frame.
        poses: at least 2.
    """
    count, between = len(rotation), poses - 2
    shares = np.linspace(0.0, 1.0, poses)[1:-1, None, None]
    points, seeds = (
        (first + shares * (last - first)).reshape(between * count, -1) for first, last in (positions, ends)
    )
    rows = np.tile(np.arange(count), between)
    inner = solve_inverse(arm.rows(rows), points, rotation[rows], seeds).joints
    return np.concatenate(
        [ends[0][:, None], np.swapaxes(inner.reshape(between, count, -1), 0, 1), ends[1][:, None]], axis=1
    )
