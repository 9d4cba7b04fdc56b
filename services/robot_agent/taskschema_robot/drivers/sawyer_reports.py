"""What a Sawyer's topics have last said, and when: put together to the state of an arm."""

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
        self._assembly: Json = {}
        self._signals: Json = {}
        self.acknowledged: list[Json] = []
        """Times of the gripper commands that the gripper knows of."""

    def take(self, topic: str, message: Json) -> None:
        """Take in a message.

        Raises:
            ValueError: if it lacks a number; the topic then counts as silent.
        """
        if topic == interface.JOINT_STATES:
            reading = read_joint_states(message)
            if self._joints is None or reading.stamp != self._joints[1].stamp:
                self._joints = (self._clock.now(), reading)
        elif topic == interface.ENDPOINT_STATE:
            self._wrench = read_wrench(message)
        elif topic == interface.COLLISION_STATE:
            self._collision = bool(message["collision_state"])
        elif topic == interface.ROBOT_STATE:
            self._assembly = message
        elif topic == interface.GRIPPER_STATE:
            self._signals = read_signals(message)
            self.acknowledged = message["commands"]
        self._arrived[topic] = self._clock.now()

    @property
    def missing(self) -> list[str]:
        """Topics that have said nothing yet."""
        return [topic for topic in TOPICS if topic not in self._arrived]

    @property
    def stopped(self) -> bool:
        """Whether the robot says that it is stopped."""
        return bool(self._assembly.get("stopped"))

    def state(self) -> ArmState | None:
        """Return the newest state; None while a topic is missing."""
        if self.missing or self._joints is None or self._wrench is None:
            return None
        (time, reading), assembly, signals = self._joints, self._assembly, self._signals
        return ArmState(
            time=time,
            stamp=reading.stamp,
            positions=reading.positions,
            velocities=reading.velocities,
            efforts=reading.efforts,
            wrench=self._wrench,
            collision=self._collision,
            enabled=bool(assembly["enabled"]),
            stopped=bool(assembly["stopped"]),
            error=bool(assembly["error"]),
            emergency_stop=assembly["estop_button"] == interface.BUTTON_PRESSED,
            gripper=GripperState(
                opening=self._finger_mount + float(signals["position_response_m"]),
                calibrated=bool(signals["is_calibrated"]),
                moving=bool(signals["is_moving"]),
                gripping=bool(signals["is_gripping"]),
                error=bool(signals["has_error"]),
            ),
            sources=tuple(
                Source(topic, self._arrived[topic], longest)
                for topic, longest in interface.LONGEST_SILENCE.items()
            ),
        )
