"""Inverse kinematics by damped least squares, in batches."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import BoolArray, FloatArray
from taskschema.kinematics.arm import ArmKinematics
from taskschema.kinematics.rotation import rotation_error

POSITION_TOLERANCE = 2e-4
"""[m]"""
ORIENTATION_TOLERANCE = 1e-3
"""[rad]"""
ITERATIONS = 16
"""Most iterations with position and orientation together, and again for position first."""
ORIENTATION_WEIGHT = 0.3
"""Metres of position error that one radian counts as."""
FALLBACK_ORIENTATION_WEIGHT = 0.01
"""The same once a pose has proved out of reach: position before orientation."""
DAMPING = 0.1
"""Damping per squared error: strong far away, none at the goal (Sugihara 2011, 10.1109/TRO.2011.2148230)."""
DAMPING_FLOOR = 1e-6
LARGEST_STEP = 0.5
"""[rad] largest joint step of one iteration."""


@dataclass(frozen=True)
class InverseResult:
    """Joint angles found, and which poses they reach."""

    joints: FloatArray
    """[N, J] inside the joint limits [rad]."""
    reached: BoolArray
    """[N] whether position and orientation are within tolerance."""


def solve_inverse(
    arm: ArmKinematics, position: FloatArray, rotation: FloatArray, seed: FloatArray
) -> InverseResult:
    """Find joint angles for end-effector poses in the world frame.

    Each row stops when it has converged and is then frozen, so that its result does not depend on the others.
    A pose out of reach is approached as near as it can be: position before orientation.

    Args:
        arm: the arm of J joints, or those of the rows.
        position: [N, 3] in metres.
        rotation: [N, 3, 3].
        seed: [N, J] joint angles to start from.
    """
    position, rotation = arm.in_base(position, rotation)
    joints, reached = _iterate(arm, position, rotation, seed, ORIENTATION_WEIGHT)
    far = np.flatnonzero(~reached)
    if len(far):
        again, _ = _iterate(arm, position[far], rotation[far], joints[far], FALLBACK_ORIENTATION_WEIGHT)
        joints[far] = again
    return InverseResult(joints, reached)


def _iterate(
    arm: ArmKinematics, position: FloatArray, rotation: FloatArray, seed: FloatArray, weight: float
) -> tuple[FloatArray, BoolArray]:
    joints = np.clip(np.array(seed, dtype=np.float64), arm.lower, arm.upper)
    reached = np.zeros(len(joints), dtype=bool)
    active, now = np.arange(len(joints)), joints
    for _ in range(ITERATIONS):
        here, facing, jacobian = arm.forward_and_jacobian(now)
        offset, turn = position - here, rotation_error(rotation, facing)
        done = (_norm(offset) < POSITION_TOLERANCE) & (_norm(turn) < ORIENTATION_TOLERANCE)
        if done.any():
            reached[active[done]], joints[active[done]] = True, now[done]
            going = np.flatnonzero(~done)
            if not len(going):
                return joints, reached
            active, now, position, rotation = active[going], now[going], position[going], rotation[going]
            jacobian, offset, turn = jacobian[going], offset[going], turn[going]
        now = np.clip(now + _damped_step(jacobian, offset, turn, weight), arm.lower, arm.upper)
    joints[active] = now
    return joints, reached


def _damped_step(jacobian: FloatArray, offset: FloatArray, turn: FloatArray, weight: float) -> FloatArray:
    """Return the step J^T (J J^T + damping I)^-1 e [N, J] of the weighted error e."""
    weighted = jacobian.copy()
    weighted[:, 3:] *= weight
    error = np.concatenate([offset, turn * weight], axis=1)
    damping = DAMPING * _norm(error) ** 2 + DAMPING_FLOOR
    transposed = np.swapaxes(weighted, 1, 2)
    # Stacked products and solves run matrix by matrix: the batch size does not enter. One factor is a copy: a
    # product of the very same numbers would go to a routine that is four times as slow for small matrices.
    normal = weighted @ transposed.copy()
    normal.reshape(-1, 36)[:, ::7] += damping[:, None]
    step = (transposed @ np.linalg.solve(normal, error[:, :, None]))[:, :, 0]
    largest = np.abs(step).max(axis=1)
    return np.asarray(step * np.minimum(1.0, LARGEST_STEP / np.maximum(largest, 1e-12))[:, None])


def _norm(vectors: FloatArray) -> FloatArray:
    """Return the lengths [N] of [N, d], summed in a fixed order."""
    total = vectors[:, 0] * vectors[:, 0]
    for column in range(1, vectors.shape[1]):
        total = total + vectors[:, column] * vectors[:, column]
    return np.sqrt(total)
