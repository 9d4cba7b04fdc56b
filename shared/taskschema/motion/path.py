"""The timed path of one arm and its gripper."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taskschema.arrays import BoolArray, FloatArray, IntArray


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

    def sample(
        self, times: FloatArray, rows: IntArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return joints and their velocities [N, S, 7] and gripper set-points [N, S].

        Args:
            times: [S] never decreasing [s].
            rows: [N] episodes; None: all.

        """
        span, moving, cubics = self._cubics
        chosen = np.arange(len(self.times)) if rows is None else rows
        interval = _last_knots(self.times[chosen], times) + chosen[:, None] * self.times.shape[1]
        u = np.where(moving.take(interval), (times - self.times.take(interval)) / span.take(interval), 0.0)
        c0, c1, c2, c3 = (coefficient.take(interval, axis=1) for coefficient in cubics)
        joints = ((c3 * u + c2) * u + c1) * u + c0
        velocities = ((3.0 * c3 * u + 2.0 * c2) * u + c1) / span.take(interval)
        return np.moveaxis(joints, 0, 2), np.moveaxis(velocities, 0, 2), self.opening.take(interval)

    @cached_property
    def _cubics(self) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Durations [N, P] from each knot on [s], whether it moves, and cubics [4, 7, N * P] in their share.

        An interval of no duration is passed at once, and after the last knot the path holds.
        """
        span = np.diff(self.times, axis=1, append=np.inf)
        moving = (span > 0.0) & (span < np.inf)
        span = np.where(moving, span, 1.0)
        # Joints come first: what is stretched over them is then not innermost, where NumPy would be slow.
        p0, speeds = (np.ascontiguousarray(np.moveaxis(at, 2, 0)) for at in (self.joints, self.velocities))
        m0 = speeds * span
        change, m1 = np.zeros_like(p0), np.zeros_like(p0)
        change[:, :, :-1] = np.diff(p0, axis=2)
        m1[:, :, :-1] = speeds[:, :, 1:] * span[:, :-1]
        cubics = np.stack([p0, m0, 3.0 * change - 2.0 * m0 - m1, m0 + m1 - 2.0 * change])
        cubics[1:] *= moving
        return span, moving, cubics.reshape(4, len(p0), -1)


def _last_knots(knots: FloatArray, times: FloatArray) -> IntArray:
    """Return the last of each row's knots [N, P] that is passed at each of `times` [S]: [N, S]."""
    rows, samples = len(knots), len(times)
    first = np.searchsorted(times, knots) + np.arange(rows)[:, None] * (samples + 1)
    passed = np.bincount(first.ravel(), minlength=rows * (samples + 1)).reshape(rows, samples + 1)
    return np.cumsum(passed[:, :samples], axis=1) - 1
