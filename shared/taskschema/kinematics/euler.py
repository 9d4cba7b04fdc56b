"""Euler angles in batches."""

import numpy as np

from taskschema.arrays import FloatArray


def roll_pitch_yaw_quaternion(angles: FloatArray) -> FloatArray:
    """Return unit quaternions [N, 4], w x y z, of roll, pitch and yaw [N, 3] in radians.

    The angles turn about the fixed x axis, then the fixed y axis, then the fixed z axis (the convention of
    URDF and ROS).
    """
    # Trigonometry runs on one contiguous array: strided and contiguous loops may differ in the last bit.
    half = np.ascontiguousarray(0.5 * angles.T)
    (cr, cp, cy), (sr, sp, sy) = np.cos(half), np.sin(half)
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )
