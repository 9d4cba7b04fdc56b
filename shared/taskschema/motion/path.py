"""The timed path of one arm and its gripper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ArmPath:
    """Set-points of one arm over time, for N episodes: P knots each, cubic between them.

    Times start at 0 and never decrease. A path begins and ends at rest; after its end it holds. `sample`
    gives the set-points at any rate: a simulator's every step, a robot driver's 50 to 100 Hz.
    """

    times: FloatArray
    """[N, P] when each knot is passed [s]."""
    joints: FloatArray
    """[N, P, 7] joint angles at the knots [rad]."""
    velocities: FloatArray
    """[N, P, 7] joint velocities at the knots [rad/s]."""
    opening: FloatArray
    """[N, P] gripper set-point from each knot on: opening between the pads [m]."""

    @staticmethod
    def stay(joints: FloatArray, opening: FloatArray) -> ArmPath:
        """Return the path of no duration at `joints` [N, 7] with the gripper set to `opening` [N]."""
        return ArmPath(
            times=np.zeros((len(joints), 1)),
            joints=joints[:, None, :].copy(),
            velocities=np.zeros((len(joints), 1, joints.shape[1])),
            opening=np.asarray(opening, dtype=np.float64)[:, None].copy(),
        )

    @property
    def duration(self) -> FloatArray:
        """[N] seconds until the path ends."""
        return self.times[:, -1]

    def then(self, following: ArmPath) -> ArmPath:
        """Return this path followed by another one, which starts where this one ends."""
        return ArmPath(
            times=np.concatenate([self.times, self.times[:, -1:] + following.times], axis=1),
            joints=np.concatenate([self.joints, following.joints], axis=1),
            velocities=np.concatenate([self.velocities, following.velocities], axis=1),
            opening=np.concatenate([self.opening, following.opening], axis=1),
        )

    def then_grip(self, opening: FloatArray, seconds: FloatArray) -> ArmPath:
        """Return this path followed by setting the gripper to `opening` [N] and waiting for `seconds` [N]."""
        start = ArmPath.stay(self.joints[:, -1], opening)
        end = ArmPath(seconds[:, None], start.joints, start.velocities, start.opening)
        return self.then(start).then(end)

    def sample(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return joints and their velocities [N, S, 7] and gripper set-points [N, S] at `times` [S]."""
        index = np.stack([np.searchsorted(row, times, side="right") for row in self.times]) - 1
        rows = np.arange(len(self.times))[:, None]
        last = self.times.shape[1] - 1
        after = np.minimum(index + 1, last)
        span = self.times[rows, after] - self.times[rows, index]
        inside = span > 0.0
        span = np.where(inside, span, 1.0)
        u = np.where(inside, (times - self.times[rows, index]) / span, 0.0)[:, :, None]
        p0, p1 = self.joints[rows, index], self.joints[rows, after]
        m0, m1 = (self.velocities[rows, at] * span[:, :, None] for at in (index, after))
        square, cube = u * u, u * u * u
        joints = (
            (2 * cube - 3 * square + 1) * p0
            + (cube - 2 * square + u) * m0
            + (3 * square - 2 * cube) * p1
            + (cube - square) * m1
        )
        slope = 6 * (square - u) * (p0 - p1) + (3 * square - 4 * u + 1) * m0 + (3 * square - 2 * u) * m1
        velocities = np.where(inside[:, :, None], slope / span[:, :, None], 0.0)
        return joints, velocities, self.opening[rows, index]
