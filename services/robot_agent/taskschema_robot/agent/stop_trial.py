"""A trial of the stop key: how far both arms run on after it, and when they rest."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.safety.limits import SafetyLimits
from taskschema.skills.pairs import ARMS
from taskschema_robot.agent.slow_motion import WRIST, measured_joints, move, slow_motion
from taskschema_robot.clock import Clock
from taskschema_robot.errors import RobotError
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gated_arms import GatedArms

TURN = 1.5
"""How far both wrists turn [rad]: some seconds at a tenth of their speed."""
SWINGS = 4
"""To and fro, after which nobody presses any more."""
AT_REST = 0.02
"""No joint is faster [rad/s]."""
REST_SECONDS = 5.0
"""Within which an arm that was told to stop has to rest [s]."""
LOOK_SECONDS = 0.005
"""Between two looks whether it does [s]."""


@dataclass(frozen=True, eq=False)
class _Stop:
    """What was known when the arms were told to stop."""

    time: float
    """On the agent's clock [s]."""
    positions: FloatArray
    """[2, 7] newest measured joint angles [rad]: at most one joint state old, so what follows is no less."""
    speed: float
    """Of the fastest joint [rad/s]."""


class StopTrial:
    """Turns both wrists until somebody stops them, and measures what follows.

    Args:
        arms: behind the gate.
        clock: the agent's.
        limits: the gate's.

    """

    def __init__(self, arms: GatedArms, clock: Clock, limits: SafetyLimits) -> None:
        self._arms, self._clock, self._limits = arms, clock, limits
        self._stop: _Stop | None = None

    def stop(self, reason: str) -> None:
        """Stop both arms, and note where they are: what a stop key has to call. From any thread."""
        try:
            positions, speed = measured_joints(self._arms), self._speed()
            self._stop = _Stop(self._clock.now(), positions, speed)
        finally:
            self._arms.stop(reason)

    def run(self, press: Callable[[Callable[[str], None]], None]) -> str:
        """Turn both wrists, measure the stop, and return its words; it stays latched.

        Args:
            press: has the stop key pressed, or what stands for it called; need not wait for it.

        Raises:
            RobotError: if nobody stops them, another fault does, or they do not come to rest.

        """
        start, self._stop = measured_joints(self._arms), None
        end = start.copy()
        end[:, WRIST] -= np.copysign(TURN, start[:, WRIST])
        press(self.stop)
        try:
            for swing in range(SWINGS):
                first, last = (start, end) if swing % 2 == 0 else (end, start)
                move(self._arms, slow_motion(first, last, self._limits))
        except FaultError:
            if self._stop is None:
                raise
            return self._words(self._stop)
        raise RobotError("nobody pressed it, or it stops nothing: do not use it.")

    def _words(self, stop: _Stop) -> str:
        if stop.speed < AT_REST:
            raise RobotError("it was pressed while the wrists stood still: begin again.")
        seconds = self._seconds_to_rest(stop)
        far = np.abs(measured_joints(self._arms) - stop.positions).max(axis=1)
        ways = ", ".join(f"{name} {way:.3f} rad" for name, way in zip(ARMS, far, strict=True))
        return f"at {stop.speed:.2f} rad/s they ran on by {ways}, and rested {seconds:.2f} s after it"

    def _seconds_to_rest(self, stop: _Stop) -> float:
        """Wait until no joint moves by a state from after the stop; return how long that took [s]."""
        while True:
            newest = min(state.time for state in self._arms.states())
            if newest > stop.time and self._speed() < AT_REST:
                return newest - stop.time
            if self._clock.now() > stop.time + REST_SECONDS:
                raise RobotError(f"an arm does not rest {REST_SECONDS:.0f} s after the stop: do not use it.")
            self._clock.sleep_until(self._clock.now() + LOOK_SECONDS)

    def _speed(self) -> float:
        return max(float(np.abs(state.velocities).max()) for state in self._arms.states())
