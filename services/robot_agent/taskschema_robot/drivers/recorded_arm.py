"""An arm whose last seconds are at hand: what it was sent, and what it said of itself."""

import dataclasses
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema_robot.drivers.driver import ArmDriver, ArmState

RECORDED_SECONDS = 5.0
"""[s]"""
NOTHING_SENT = np.full(7, np.nan)


class _Sample(NamedTuple):
    joints: FloatArray
    """[7] set-point [rad]."""
    opening: float
    """That the gripper was last sent to [m]."""
    state: ArmState


class RecordedArm:
    """A driver that notes every set-point it has sent, with the newest state; all else is the driver's own.

    It is noted once it is sent, so that nothing waits for it.
    """

    def __init__(self, driver: ArmDriver) -> None:
        self._driver = driver
        self._samples: deque[_Sample] = deque()
        self._opening = np.nan

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the driver has
        """Return what the driver has by a name."""
        return getattr(self._driver, name)

    def command(self, positions: FloatArray) -> None:
        """Send one set-point; see `ArmDriver`."""
        self._driver.command(positions)
        self._note(positions)

    def set_gripper(self, opening: float) -> None:
        """Send the gripper to an opening; see `ArmDriver`."""
        self._driver.set_gripper(opening)
        self._opening = opening

    def _note(self, positions: FloatArray) -> None:
        state = self._driver.state()
        self._samples.append(_Sample(positions, self._opening, state))
        while self._samples[0].state.time < state.time - RECORDED_SECONDS:
            self._samples.popleft()

    def last_seconds(self) -> dict[str, AnyArray]:
        """Return what was noted before the newest state, [N, ...] each, and that state at the end.

        Raises:
            NotConnectedError: if there has never been a state.
        """
        newest = self._driver.state()
        begin = newest.time - RECORDED_SECONDS
        samples = [sample for sample in self._samples.copy() if sample.state.time >= begin]
        samples.append(_Sample(NOTHING_SENT, self._opening, newest))
        states = [sample.state for sample in samples]
        measured = {name: np.stack([getattr(state, name) for state in states]) for name in MEASURED}
        gripper = [dataclasses.asdict(state.gripper) for state in states]
        return {
            "set_points": np.stack([sample.joints for sample in samples]),
            "set_opening": np.array([sample.opening for sample in samples]),
            **measured,
            **{f"gripper_{name}": np.array([each[name] for each in gripper]) for name in gripper[0]},
        }


MEASURED = (
    "time",
    "positions",
    "velocities",
    "efforts",
    "wrench",
    "collision",
    "enabled",
    "stopped",
    "error",
    "emergency_stop",
)
"""Of `ArmState`."""
