"""A motion of both arms as the gate takes it: set-points at a fixed period, and what the hands hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.motion import ArmPath


@dataclass(frozen=True, eq=False)
class HeldObject:
    """A rigid box in a hand: the object's bounding box where the fingers hold it."""

    size: FloatArray
    """[3] edge lengths [m]."""
    position: FloatArray
    """[3] its centre in the end effector's frame [m]."""
    rotation: FloatArray
    """[3, 3] its orientation in the end effector's frame."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Set-points of both arms, left first, one every `period`; the first is where the arms are.

    Nothing is checked here: that is the gate's work, and it takes whatever comes.
    """

    joints: AnyArray
    """[2, S, 7] joint angles [rad]."""
    opening: AnyArray
    """[2, S] gripper set-points: opening between the pads [m]."""
    period: float
    """[s]"""
    goals: tuple[AnyArray | None, AnyArray | None] = (None, None)
    """Where in the world each hand is meant to end [m]: x, y and perhaps z; None where nothing was asked."""
    held: tuple[HeldObject | None, HeldObject | None] = (None, None)
    """What each hand holds throughout."""

    @staticmethod
    def of_paths(
        left: ArmPath,
        right: ArmPath,
        period: float,
        *,
        speed_ratio: float = 1.0,
        goals: tuple[AnyArray | None, AnyArray | None] = (None, None),
        held: tuple[HeldObject | None, HeldObject | None] = (None, None),
    ) -> Motion:
        """Return two paths of one episode each as set-points, run at a share of their speed.

        A slower motion is the same path in more time: velocities shrink with the ratio, accelerations with
        its square. The last set-point is the end of the longer path.
        """
        times = set_point_times(max(float(left.duration[0]), float(right.duration[0])), period, speed_ratio)
        sampled = [path.sample(times) for path in (left, right)]
        return Motion(
            joints=np.stack([joints[0] for joints, _, _ in sampled]),
            opening=np.stack([opening[0] for _, _, opening in sampled]),
            period=period,
            goals=goals,
            held=held,
        )

    def __len__(self) -> int:
        """Return S."""
        return int(np.shape(self.joints)[1])

    @property
    def duration(self) -> float:
        """Seconds from the first set-point to the last."""
        return (len(self) - 1) * self.period


def set_point_times(duration: float, period: float, speed_ratio: float = 1.0) -> FloatArray:
    """Return where on paths of `duration` [s], run at a share of their speed, the set-points lie [S] [s]."""
    slowed = duration / speed_ratio
    count = max(int(np.ceil(slowed / period - 1e-9)), 1)
    return np.asarray(np.minimum(np.arange(count + 1) * period, slowed) * speed_ratio)
