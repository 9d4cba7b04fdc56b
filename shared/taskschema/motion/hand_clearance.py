"""Keeping a hand in any orientation above the table."""

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import rethink_gripper

TABLE_MARGIN = 0.006
"""[m] that the hand keeps above the table."""
PAD_RADIUS = 0.004
"""Of the round finger pads [m]."""
PALM, WRIST = (-0.069, 0.030), (-0.150, 0.050)
"""Centre on the end effector's z axis and radius of a sphere around each [m]."""


def tilted_clear(rotation: FloatArray, height: FloatArray) -> FloatArray:
    """Tilt hands that point up so far that palm or wrist would be in the table; position before orientation.

    Args:
        rotation: [N, 3, 3] end effectors in the world frame.
        height: [N] of the end effectors above the table [m].

    Returns:
        [N, 3, 3] the nearest orientations, turned in their own vertical planes, at which the hands are clear.
    """
    steepest = np.ones(len(height))
    for centre, radius in (PALM, WRIST):
        steepest = np.minimum(steepest, (height - radius - TABLE_MARGIN) / -centre)
    x, y, z = (np.ascontiguousarray(rotation[:, row, 2]) for row in range(3))
    level = np.sqrt(x * x + y * y)
    excess = np.arctan2(z, level) - np.arcsin(np.clip(steepest, -1.0, 1.0))
    sine, cosine = np.sin(np.maximum(excess, 0.0)), np.cos(np.maximum(excess, 0.0))
    # The axis is horizontal, square to where the hand points; a hand that points straight up turns about x.
    upright = level < 1e-9
    length = np.where(upright, 1.0, level)
    u, v = np.where(upright, 1.0, -y / length), np.where(upright, 0.0, x / length)
    turn = np.empty_like(rotation)
    turn[:, 0] = np.stack([cosine + u * u * (1 - cosine), u * v * (1 - cosine), v * sine], axis=1)
    turn[:, 1] = np.stack([u * v * (1 - cosine), cosine + v * v * (1 - cosine), -u * sine], axis=1)
    turn[:, 2] = np.stack([-v * sine, u * sine, cosine], axis=1)
    return np.asarray(turn @ rotation)


def least_height(rotation: FloatArray) -> FloatArray:
    """Return the least height [N] [m] of end effectors [N, 3, 3] at which the open hand clears the table."""
    gripper = rethink_gripper()
    x, z = rotation[:, 2, 0], rotation[:, 2, 2]
    side, tip = 0.5 * gripper.open + PAD_RADIUS, gripper.fingertip - PAD_RADIUS
    needed = [PAD_RADIUS + side * np.abs(x) - tip * z]
    needed += [radius - centre * z for centre, radius in (PALM, WRIST)]
    return np.asarray(np.max(needed, axis=0) + TABLE_MARGIN)
