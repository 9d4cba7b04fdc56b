"""The last check of a set-point: near enough that an arm which gets no further ones stops in time."""

from collections.abc import Sequence

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.arm import ArmKinematics
from taskschema_robot.errors import SetpointError

MEASURED_SHARE = 2.0
"""Largest distance from the measured angles, in stopping distances: an arm that follows at full speed lags
behind its set-points by one, and by its servos' delay."""


class SetpointCheck:
    """Compares set-points of one arm with the one before and with where the arm is.

    In position mode a Sawyer finishes a move under way when commands stop. So no set-point may be farther
    from the one before than velocity^2 / (2 acceleration), what a joint at its velocity limit takes to stop:
    an arm that is left alone then goes no further than one that brakes.

    Args:
        arm: whose limits hold.
        names: of its joints, for messages.

    """

    def __init__(self, arm: ArmKinematics, names: Sequence[str]) -> None:
        self._arm = arm
        self._names = names
        self.stopping_distance: FloatArray = arm.velocity**2 / (2.0 * arm.acceleration)
        """[7] from each joint's velocity limit [rad]."""

    def require(self, positions: FloatArray, last: FloatArray | None, measured: FloatArray) -> None:
        """Check a set-point.

        Args:
            positions: [7] the new one [rad].
            last: [7] the one before; None: there is none, and the measured angles stand for it.
            measured: [7] [rad].

        Raises:
            SetpointError: if it may not be sent; the message names the joint.
        """
        if positions.shape != self.stopping_distance.shape or not np.isfinite(positions).all():
            raise SetpointError(f"A set-point is {len(self._names)} finite angles, got {positions}.")
        outside = (positions < self._arm.lower) | (positions > self._arm.upper)
        self._refuse(outside, positions, "is outside the joint's limits")
        before = measured if last is None else last
        far = np.abs(positions - before) > self.stopping_distance
        self._refuse(far, positions, "is farther from the last set-point than the joint takes to stop")
        behind = np.abs(positions - measured) > MEASURED_SHARE * self.stopping_distance
        self._refuse(behind, positions, "is too far from where the joint is: it does not follow")

    def _refuse(self, wrong: np.ndarray, positions: FloatArray, reason: str) -> None:
        if wrong.any():
            joint = int(np.flatnonzero(wrong)[0])
            raise SetpointError(f"Set-point {positions[joint]:.4f} rad of {self._names[joint]} {reason}.")
