"""Rotations in batches: matrices [..., 3, 3] and unit quaternions [..., 4] as w, x, y, z.

Sums are written out term by term: their order, and so their last bit, never depends on the batch size.
"""

import numpy as np

from taskschema.arrays import AnyArray, FloatArray


def quaternion_product(first: AnyArray, second: AnyArray) -> FloatArray:
    """Return the rotation `second` followed by `first`, both [..., 4]."""
    w1, x1, y1, z1 = np.moveaxis(first, -1, 0)
    w2, x2, y2, z2 = np.moveaxis(second, -1, 0)
    return np.stack(
        [
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ],
        axis=-1,
    )


def quaternion_conjugate(quaternion: AnyArray) -> FloatArray:
    """Return the inverse rotation of unit quaternions [..., 4]."""
    return np.asarray(quaternion * np.array([1.0, -1.0, -1.0, -1.0]))


def half_angle_cosine(quaternion: AnyArray, reference: AnyArray) -> FloatArray:
    """Return the cosine [...] of half the angle between orientations [..., 4], at least 0."""
    product = quaternion * reference
    return np.asarray(np.abs(product[..., 0] + product[..., 1] + product[..., 2] + product[..., 3]))


def rotate(quaternion: AnyArray, vector: AnyArray) -> FloatArray:
    """Rotate vectors [..., 3] by unit quaternions [..., 4]."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    a, b, c = np.moveaxis(vector, -1, 0)
    u, v, s = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return np.stack(
        [a + w * u + y * s - z * v, b + w * v + z * u - x * s, c + w * s + x * v - y * u], axis=-1
    )


def same_hemisphere(quaternion: AnyArray, reference: AnyArray) -> FloatArray:
    """Choose between q and -q, which are the same rotation, the one nearer to `reference` [4]."""
    product = quaternion * reference
    dot = product[..., 0] + product[..., 1] + product[..., 2] + product[..., 3]
    return np.asarray(np.where(dot[..., None] < 0, -quaternion, quaternion))


def matrix_to_quaternion(matrix: AnyArray) -> FloatArray:
    """Return unit quaternions [..., 4] of rotation matrices [..., 3, 3], by the largest component."""
    m = np.asarray(matrix, dtype=np.float64)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], axis=-1)
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 1, 0] + m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0], m[..., 2, 1] + m[..., 1, 2]
    rows = np.stack(
        [
            np.stack([squares[..., 0], wx, wy, wz], axis=-1),
            np.stack([wx, squares[..., 1], xy, xz], axis=-1),
            np.stack([wy, xy, squares[..., 2], yz], axis=-1),
            np.stack([wz, xz, yz, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(squares, axis=-1)
    chosen = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    size = np.take_along_axis(squares, largest[..., None], axis=-1)
    return np.asarray(chosen * (0.5 / np.sqrt(size)))


def rotation_error(target: AnyArray, current: AnyArray) -> FloatArray:
    """Return the world-frame rotation vector [N, 3] that turns `current` into `target`, both [N, 3, 3]."""
    m = target @ np.swapaxes(current, -1, -2)
    # Twice the sine of the angle along the axis; at exactly half a turn the axis is lost, and the error is 0.
    x, y, z = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    sine = np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(sine, m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2] - 1.0)
    factor = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 0.5)
    return np.stack([x * factor, y * factor, z * factor], axis=1)


def vertical_turn(angle: AnyArray) -> FloatArray:
    """Return rotation matrices [N, 3, 3] about the world's z axis by `angle` [N] in radians."""
    cosine, sine = np.cos(angle), np.sin(angle)
    matrices = np.zeros((*np.shape(angle), 3, 3))
    matrices[..., 0, 0] = matrices[..., 1, 1] = cosine
    matrices[..., 0, 1], matrices[..., 1, 0] = -sine, sine
    matrices[..., 2, 2] = 1.0
    return matrices
