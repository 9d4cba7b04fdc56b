"""What every driver checks before it sends a set-point."""

import threading

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.arm import ArmKinematics
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmState
from taskschema_robot.drivers.setpoints import SetpointCheck
from taskschema_robot.errors import NotReadyError, StaleStateError
from taskschema_robot.sawyer_interface import JOINT_NAMES

STALE_SECONDS = 0.1
"""Age of the joint state above which no set-point is sent [s]."""
FORGET_SECONDS = 0.2
"""After a pause this long the measured angles stand for the last set-point [s]."""


class CommandGuard:
    """Lets a set-point pass if the arm is ready, its state is fresh, and the step is small.

    Args:
        name: of the arm, for messages.
        arm: whose limits hold.
        clock: of the agent.

    """

    def __init__(self, name: str, arm: ArmKinematics, clock: Clock) -> None:
        self._name = name
        self._clock = clock
        self._check = SetpointCheck(arm, JOINT_NAMES)
        self._lock = threading.Lock()
        self._last: tuple[float, FloatArray] | None = None

    def forget(self) -> None:
        """Compare the next set-point with the measured angles."""
        self._last = None

    def require(self, state: ArmState, positions: FloatArray) -> None:
        """Check a set-point [7], and remember it; see `ArmDriver.command` for the errors."""
        now = self._clock.now()
        if now - state.time > STALE_SECONDS:
            raise StaleStateError(
                f"{self._name}: the last joint state is {now - state.time:.2f} s old: check the network."
            )
        if not state.ready:
            raise NotReadyError(f"{self._name}: {why_not_ready(state)}: reset it, then enable it.")
        with self._lock:
            last = self._last[1] if self._last and now - self._last[0] < FORGET_SECONDS else None
            self._check.require(positions, last, state.positions)
            self._last = (now, np.array(positions))


def why_not_ready(state: ArmState) -> str:
    """Return in words what keeps an arm from obeying motion commands."""
    if state.emergency_stop:
        return "its emergency stop button is pressed"
    if state.error:
        return "it reports an error"
    if state.stopped:
        return "it is stopped"
    if state.collision:
        return "it reports a collision"
    return "it is enabled" if state.enabled else "it is not enabled"
