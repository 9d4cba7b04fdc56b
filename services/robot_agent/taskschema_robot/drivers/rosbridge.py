"""A Sawyer behind rosbridge."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import GRIPPER_STROKE, sawyer
from taskschema_robot import sawyer_interface as interface
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.bridge_connection import BridgeConnection
from taskschema_robot.drivers.command_guard import CommandGuard, why_not_ready
from taskschema_robot.drivers.driver import ArmState
from taskschema_robot.drivers.input_output import InputOutput, input_output
from taskschema_robot.drivers.repeated_command import REPEAT_SECONDS, RepeatedCommand
from taskschema_robot.drivers.sawyer_messages import joint_command, signal_command
from taskschema_robot.drivers.sawyer_reports import TOPICS, SawyerReports
from taskschema_robot.errors import EffectTimeoutError, NotConnectedError, NotReadyError

Json = dict[str, Any]

LINK_SECONDS = 0.5
"""From advertising until commands pass without delay [s]: the bridge's own connections take 0.3 s."""
EFFECT_SECONDS = 5.0
"""How long a switch may take to show its effect [s], as in the vendor's SDK."""
CALIBRATION_SECONDS = 15.0
POLL_SECONDS = 0.02
ENDPOINT_MILLISECONDS = 15
"""Least time between two end-point states [ms]: every second one of 100 a second suffices for the wrench."""

ADVERTISEMENTS = (
    interface.JOINT_COMMAND,
    interface.SPEED_RATIO,
    interface.ENABLE,
    interface.STOP,
    interface.RESET,
    interface.GRIPPER_COMMAND,
)


@dataclass(frozen=True)
class RosbridgeAddress:
    """Where one robot is, and how its gripper is built."""

    url: str
    """Of its rosbridge, such as `ws://192.168.1.10:9090`."""
    finger_mount: float
    """Opening between the pads with the gripper fully closed [m]: as its fingers are screwed on."""
    ping_seconds: float | None = 0.5
    """Between pings [s]; None: no pings, for a twin in lock-step."""
    state_milliseconds: int = 0
    """Least time between two joint states [ms]; 0: all. A twin in lock-step sends no more than are read."""


class RosbridgeArm:
    """One Sawyer with its electric gripper; see `ArmDriver`.

    Errors of what is published never reach a rosbridge client, so every command is confirmed by its effect on
    the robot's state.

    Args:
        name: `left` or `right`.
        address: of its bridge.
        clock: of the agent.
        io: where its connection lives; None: the process' own thread. A twin's clock in lock-step has one.

    """

    def __init__(
        self, name: str, address: RosbridgeAddress, clock: Clock, io: InputOutput | None = None
    ) -> None:
        self.name = name
        self._address = address
        self._clock = clock
        self._input_output = io or input_output()
        self._guard = CommandGuard(name, sawyer(), clock)
        self._connection: BridgeConnection | None = None
        self._forget()

    def _forget(self) -> None:
        self._reports = SawyerReports(self._clock, self._address.finger_mount)
        self._guard.forget()
        self._stopping: RepeatedCommand | None = None
        self._gripping: RepeatedCommand | None = None
        self._last_signal_time = 0.0

    @property
    def connection(self) -> BridgeConnection | None:
        """The present connection: a twin in lock-step counts its frames."""
        return self._connection

    @property
    def connected(self) -> bool:
        """Whether the connection is alive."""
        return self._connection is not None and self._connection.is_open

    def connect(self) -> None:
        """Connect, from nothing: neither commands nor states of an earlier connection survive."""
        self.close()
        self._forget()
        connection = BridgeConnection(
            self._address.url, self._on_publish, self._input_output, self._address.ping_seconds
        )
        connection.open()
        self._connection = connection
        for topic in ADVERTISEMENTS:
            latch = topic == interface.SPEED_RATIO
            queue = 1 if topic == interface.JOINT_COMMAND else 10
            operation: Json = {"op": "advertise", "topic": topic, "type": interface.TYPES[topic]}
            connection.send(operation | {"latch": latch, "queue_size": queue})
        throttles = {
            interface.JOINT_STATES: self._address.state_milliseconds,
            interface.ENDPOINT_STATE: ENDPOINT_MILLISECONDS,
        }
        for topic in TOPICS:
            # Without a queue length, a client that reads slowly holds up everybody else's topics too.
            operation = {"op": "subscribe", "topic": topic, "type": interface.TYPES[topic]}
            connection.send(operation | {"throttle_rate": throttles.get(topic, 0), "queue_length": 1})
        start = self._clock.now()
        if not self._wait_for(lambda: not self._reports.missing, EFFECT_SECONDS):
            missing = ", ".join(self._reports.missing)
            self.close()
            raise NotConnectedError(
                f"{self.name}: {self._address.url} answers, but nothing comes from {missing}: check that the"
                " robot is up and its gripper is attached."
            )
        self._clock.sleep_until(start + LINK_SECONDS)

    def state(self) -> ArmState:
        """Return the newest state; see `ArmDriver`."""
        state = self._reports.state()
        if state is None:
            raise NotConnectedError(f"{self.name}: no state yet: connect first.")
        return state

    def command(self, positions: FloatArray) -> None:
        """Send one set-point; see `ArmDriver`."""
        connection, state = self._require_connection(), self.state()
        self._require_no_stop()
        self._guard.require(state, positions)
        connection.send_motion(_publish(interface.JOINT_COMMAND, joint_command(positions)), self._may_move)

    def set_speed_ratio(self, ratio: float) -> None:
        """Limit the arm's own speed; see `ArmDriver`."""
        self._require_connection().send(_publish(interface.SPEED_RATIO, {"data": float(ratio)}))

    def set_gripper(self, opening: float) -> None:
        """Send the gripper to an opening; see `ArmDriver`."""
        gripper = self.state().gripper
        if not gripper.calibrated or gripper.error:
            what = "reports an error" if gripper.error else "is not calibrated"
            raise NotReadyError(f"{self.name}: the gripper {what}: calibrate it.")
        travel = min(max(opening - self._address.finger_mount, 0.0), GRIPPER_STROKE)
        self._gripping = self._send_signal("position_m", travel)

    @property
    def gripper_acknowledged(self) -> bool:
        """Whether the gripper has acknowledged its newest command."""
        return self._gripping is None or self._gripping.done()

    def calibrate_gripper(self) -> None:
        """Calibrate the gripper; see `ArmDriver`."""
        self._gripping = self._send_signal("calibrate", True)
        self._wait_for(lambda: self.state().gripper.calibrated or not self._may_move(), CALIBRATION_SECONDS)
        self._require_no_stop()
        if not self.state().gripper.calibrated:
            raise EffectTimeoutError(
                f"{self.name}: the gripper is not calibrated after {CALIBRATION_SECONDS:.0f} s: check that"
                " its fingers move freely."
            )

    def stop(self) -> None:
        """Stop at once; see `ArmDriver`."""
        reports = self._reports
        self._stopping = RepeatedCommand(interface.STOP, {}, lambda: reports.stopped, self._clock.now())
        self._guard.forget()
        if self._connection is not None:
            self._connection.send_soon(_publish(interface.STOP, {}))

    def reset(self) -> None:
        """End a stop or an error; see `ArmDriver`."""
        state, stopping = self.state(), self._stopping
        if state.emergency_stop:
            raise NotReadyError(f"{self.name}: the emergency stop button is pressed: release it first.")
        if state.stopped or state.error:
            self._switch(interface.RESET, {}, lambda now: not (now.stopped or now.error), "reset")
        if self._stopping is stopping:  # and none came meanwhile
            self._stopping = None

    def enable(self) -> None:
        """Switch the motors on; see `ArmDriver`."""
        self._guard.forget()
        self._switch(interface.ENABLE, {"data": True}, lambda now: now.enabled, "enable")

    def disable(self) -> None:
        """Switch the motors off; see `ArmDriver`."""
        self._guard.forget()
        self._switch(interface.ENABLE, {"data": False}, lambda now: not now.enabled, "disable")

    def close(self) -> None:
        """End the connection; see `ArmDriver`."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _may_move(self) -> bool:
        """Return whether no stop stands."""
        return self._stopping is None

    def _require_no_stop(self) -> None:
        if not self._may_move():
            raise NotReadyError(f"{self.name}: it was told to stop: reset it, then enable it.")

    def _require_connection(self) -> BridgeConnection:
        if self._connection is None or not self._connection.is_open:
            raise NotConnectedError(f"{self.name}: no connection to {self._address.url}: connect again.")
        return self._connection

    def _switch(self, topic: str, message: Json, shown: Callable[[ArmState], bool], what: str) -> None:
        """Publish until the robot's state shows the effect.

        Raises:
            EffectTimeoutError: if it does not in time.
        """
        deadline = self._clock.now() + EFFECT_SECONDS
        while not shown(self.state()):
            if self._clock.now() >= deadline:
                raise EffectTimeoutError(
                    f"{self.name}: {what} shows no effect after {EFFECT_SECONDS:.0f} s:"
                    f" {why_not_ready(self.state())}."
                )
            self._require_connection().send(_publish(topic, message))
            self._wait_for(lambda: shown(self.state()), REPEAT_SECONDS)

    def _wait_for(self, condition: Callable[[], bool], seconds: float) -> bool:
        deadline = self._clock.now() + seconds
        while not condition() and self._clock.now() < deadline:
            self._clock.sleep_until(self._clock.now() + POLL_SECONDS)
        return condition()

    def _send_signal(self, signal: str, value: float | bool) -> RepeatedCommand:
        """Send a command to the gripper; it is repeated, under the same time, until that is acknowledged."""
        self._require_no_stop()
        connection, now = self._require_connection(), self._clock.now()
        self._last_signal_time = max(now, self._last_signal_time + 1e-6)
        message = signal_command(signal, value, self._last_signal_time)
        time, reports = message["time"], self._reports
        command = RepeatedCommand(
            interface.GRIPPER_COMMAND, message, lambda: time in reports.acknowledged, now
        )
        connection.send_motion(_publish(interface.GRIPPER_COMMAND, message), self._may_move)
        return command

    def _on_publish(self, topic: str, message: Json) -> None:
        """Take in a message, in the input-output thread."""
        self._reports.take(topic, message)
        self._repeat()

    def _repeat(self) -> None:
        now, connection = self._clock.now(), self._connection
        if self._stopping is not None and self._gripping is not None:
            self._gripping.finished = True  # a stop ends it, for good
        for command in (self._stopping, self._gripping):
            if command is not None and connection is not None and command.due(now):
                connection.send_soon(_publish(command.topic, command.message))


def _publish(topic: str, message: Json) -> Json:
    return {"op": "publish", "topic": topic, "msg": message}
