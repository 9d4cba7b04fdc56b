"""What a Sawyer's topics have last said, and when: put together to the state of an arm."""

import math
from typing import Any

from taskschema.arrays import FloatArray
from taskschema_robot import sawyer_interface as interface
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmState, GripperState, Source
from taskschema_robot.drivers.sawyer_messages import (
    JointReading,
    read_joint_states,
    read_signals,
    read_wrench,
)

Json = dict[str, Any]

TOPICS = (
    interface.JOINT_STATES,
    interface.ENDPOINT_STATE,
    interface.COLLISION_STATE,
    interface.ROBOT_STATE,
    interface.GRIPPER_STATE,
)
"""All of them are needed: a watchdog of what nobody says would never bark."""
SWITCHES = ("enabled", "stopped", "error")


class SawyerReports:
    """Takes messages in, in one thread; others may ask at any time.

    Args:
        clock: that arrivals are timed by.
        finger_mount: opening between the pads with the gripper fully closed [m].

    """

    def __init__(self, clock: Clock, finger_mount: float) -> None:
        self._clock = clock
        self._finger_mount = finger_mount
        self._arrived: dict[str, float] = {}
        self._joints: tuple[float, JointReading] | None = None
        self._wrench: FloatArray | None = None
        self._collision = False
        self._switches: dict[str, bool] = {}
        self._button = 0
        self._gripper: GripperState | None = None
        self.acknowledged: list[Json] = []
        """Times of the gripper commands that the gripper knows of."""

    def take(self, topic: str, message: Json) -> None:
        """Take in a message.

        Raises:
            LookupError, TypeError, ValueError: if it lacks something; the topic then counts as silent.
        """
        if topic == interface.JOINT_STATES:
            reading = read_joint_states(message)
            if self._joints is None or reading.stamp != self._joints[1].stamp:
                self._joints = (self._clock.now(), reading)
        elif topic == interface.ENDPOINT_STATE:
            self._wrench = read_wrench(message)
        elif topic == interface.COLLISION_STATE:
            self._collision = _flag(message, "collision_state")
        elif topic == interface.ROBOT_STATE:
            button, switches = message["estop_button"], {name: _flag(message, name) for name in SWITCHES}
            self._button, self._switches = button, switches
        elif topic == interface.GRIPPER_STATE:
            gripper, known = _read_gripper(message, self._finger_mount), list(message["commands"])
            self._gripper, self.acknowledged = gripper, known
        self._arrived[topic] = self._clock.now()

    @property
    def missing(self) -> list[str]:
        """Topics that have said nothing yet."""
        return [topic for topic in TOPICS if topic not in self._arrived]

    @property
    def stopped(self) -> bool:
        """Whether the robot says that it is stopped."""
        return self._switches.get("stopped", False)

    def state(self) -> ArmState | None:
        """Return the newest state; None while a topic is missing."""
        if self.missing or self._joints is None or self._wrench is None or self._gripper is None:
            return None
        (time, reading), switches = self._joints, self._switches
        return ArmState(
            time=time,
            stamp=reading.stamp,
            positions=reading.positions,
            velocities=reading.velocities,
            efforts=reading.efforts,
            wrench=self._wrench,
            collision=self._collision,
            enabled=switches["enabled"],
            stopped=switches["stopped"],
            error=switches["error"],
            emergency_stop=self._button == interface.BUTTON_PRESSED,
            gripper=self._gripper,
            sources=tuple(
                Source(topic, self._arrived[topic], longest)
                for topic, longest in interface.LONGEST_SILENCE.items()
            ),
        )


def _read_gripper(message: Json, finger_mount: float) -> GripperState:
    signals = read_signals(message)
    travel = float(signals["position_response_m"])
    if not math.isfinite(travel):
        raise ValueError("the fingers' travel is not finite")
    return GripperState(
        opening=finger_mount + travel,
        calibrated=_flag(signals, "is_calibrated"),
        moving=_flag(signals, "is_moving"),
        gripping=_flag(signals, "is_gripping"),
        error=_flag(signals, "has_error"),
    )


def _flag(values: Json, name: str) -> bool:
    value = values[name]
    if value is None:
        raise ValueError(f"{name} is null")
    return bool(value)
