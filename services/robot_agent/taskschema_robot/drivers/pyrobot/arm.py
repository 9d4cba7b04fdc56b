"""A Sawyer driven by PyRobot, in a process of its own. Not run on hardware."""

import contextlib
import os
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import GRIPPER_STROKE, sawyer
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.command_guard import CommandGuard, why_not_ready
from taskschema_robot.drivers.driver import ArmState, GripperState, Source
from taskschema_robot.errors import EffectTimeoutError, NotConnectedError, NotReadyError
from taskschema_robot.sawyer_interface import BUTTON_PRESSED, LONGEST_SILENCE

CHILD = Path(__file__).with_name("child.py")
START_SECONDS = 60.0
"""How long PyRobot may take to come up [s]: it waits for MoveIt."""
EFFECT_SECONDS = 8.0
CALIBRATION_SECONDS = 15.0
POLL_SECONDS = 0.02


@dataclass(frozen=True)
class PyrobotProcess:
    """How to reach one arm's PyRobot."""

    interpreter: str
    """Python that PyRobot is installed for, such as `/opt/pyrobot/bin/python`."""
    environment: dict[str, str]
    """Of the process: at least the `ROS_MASTER_URI` of this arm's robot, and what ROS' setup script sets."""
    finger_mount: float
    """Opening between the pads with the gripper fully closed [m]."""


class PyrobotArm:
    """One Sawyer with its electric gripper; see `ArmDriver`. Not run on hardware.

    A stop does not end a gripper command that is not acknowledged yet: the vendor's SDK repeats it for up to
    five seconds, and offers no way to break that off.
    """

    def __init__(self, name: str, process: PyrobotProcess, clock: Clock) -> None:
        self.name = name
        self._options = process
        self._clock = clock
        self._guard = CommandGuard(name, sawyer(), clock)
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._newest: tuple[float, dict[str, Any]] | None = None
        self._stops = self._stops_ended = 0
        self._gripper_number = 0

    @property
    def connected(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.poll() is None

    def connect(self) -> None:
        """Start the process and wait for its first state; see `ArmDriver`."""
        self.close()
        self._newest, self._gripper_number = None, 0
        self._stops_ended = self._stops
        self._guard.forget()
        command = [self._options.interpreter, str(CHILD)]
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=self._options.environment
            )
        except OSError as error:
            raise NotConnectedError(f"{self.name}: {command[0]} cannot be started: {error}.") from None
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)
        threading.Thread(target=self._read, args=(self._process,), daemon=True).start()
        self._wait_for(lambda: self._newest is not None or not self.connected, START_SECONDS)
        if self._newest is None:
            self.close()
            raise NotConnectedError(
                f"{self.name}: PyRobot does not come up: see its messages above, and check ROS_MASTER_URI."
            )
        if not self._wait_for(lambda: not self._missing() or not self.connected, EFFECT_SECONDS):
            missing = ", ".join(self._missing())
            self.close()
            raise NotConnectedError(f"{self.name}: nothing comes from {missing}: is the robot up?")

    def _missing(self) -> list[str]:
        """Return the sources that have said nothing yet."""
        ages: dict[str, float | None] = {} if self._newest is None else self._newest[1]["ages"]
        return [topic for topic, age in ages.items() if age is None]

    def _read(self, process: "subprocess.Popen[bytes]") -> None:
        for line in process.stdout or ():
            message = msgspec.json.decode(line, type=dict)
            now = self._clock.now()
            message["sources"] = tuple(
                Source(topic, now - age, LONGEST_SILENCE[topic])
                for topic, age in message["ages"].items()
                if age is not None
            )
            known = self._newest is not None and message["stamp"] == self._newest[1]["stamp"]
            self._newest = (self._newest[0] if known and self._newest is not None else now, message)

    def state(self) -> ArmState:
        """Return the newest state; see `ArmDriver`."""
        if self._newest is None:
            raise NotConnectedError(f"{self.name}: no state yet: connect first.")
        arrived, message = self._newest
        return ArmState(
            time=arrived,
            stamp=message["stamp"],
            positions=np.array(message["positions"]),
            velocities=np.array(message["velocities"]),
            efforts=np.array(message["efforts"]),
            wrench=np.array(message["wrench"]),
            collision=message["collision"],
            enabled=message["enabled"],
            stopped=message["stopped"],
            error=message["error"],
            emergency_stop=message["button"] == BUTTON_PRESSED,
            gripper=GripperState(
                opening=self._options.finger_mount + message["travel"],
                calibrated=message["calibrated"],
                moving=message["moving"],
                gripping=message["gripping"],
                error=message["gripper_error"],
            ),
            sources=message["sources"],
        )

    def command(self, positions: FloatArray) -> None:
        """Send one set-point; see `ArmDriver`."""
        self._require_no_stop()
        self._guard.require(self.state(), positions)
        self._send({"op": "command", "positions": positions.tolist()}, moves=True)

    def set_speed_ratio(self, ratio: float) -> None:
        """Limit the arm's own speed; see `ArmDriver`."""
        self._send({"op": "speed", "ratio": float(ratio)})

    def set_gripper(self, opening: float) -> None:
        """Send the gripper to an opening; see `ArmDriver`."""
        gripper = self.state().gripper
        if not gripper.calibrated or gripper.error:
            what = "reports an error" if gripper.error else "is not calibrated"
            raise NotReadyError(f"{self.name}: the gripper {what}: calibrate it.")
        travel = min(max(opening - self._options.finger_mount, 0.0), GRIPPER_STROKE)
        self._gripper_number += 1
        self._send({"op": "gripper", "travel": travel, "number": self._gripper_number}, moves=True)

    @property
    def gripper_acknowledged(self) -> bool:
        """Whether the gripper has acknowledged its newest command."""
        return self._newest is not None and self._newest[1]["acknowledged"] == self._gripper_number

    def calibrate_gripper(self) -> None:
        """Calibrate the gripper; see `ArmDriver`."""
        self._send({"op": "calibrate"}, moves=True)
        self._require_effect(
            lambda now: now.gripper.calibrated or self._stopping, "calibrate", CALIBRATION_SECONDS
        )
        self._require_no_stop()

    def stop(self) -> None:
        """Stop at once; see `ArmDriver`."""
        self._stops += 1
        self._guard.forget()
        try:
            self._send({"op": "stop"})
        except NotConnectedError:
            return

    def reset(self) -> None:
        """End a stop or an error; see `ArmDriver`."""
        state, stops = self.state(), self._stops
        if state.emergency_stop:
            raise NotReadyError(f"{self.name}: the emergency stop button is pressed: release it first.")
        if state.stopped or state.error:
            self._send({"op": "reset"})
            self._require_effect(lambda now: not (now.stopped or now.error), "reset", EFFECT_SECONDS)
        self._stops_ended = stops  # one that came meanwhile stands

    def enable(self) -> None:
        """Switch the motors on; see `ArmDriver`. The SDK's own enable would end a stop: this one refuses."""
        if self.state().stopped:
            raise EffectTimeoutError(f"{self.name}: enable has no effect: {why_not_ready(self.state())}.")
        self._guard.forget()
        self._send({"op": "enable"})
        self._require_effect(lambda now: now.enabled, "enable", EFFECT_SECONDS)

    def disable(self) -> None:
        """Switch the motors off; see `ArmDriver`."""
        self._guard.forget()
        self._send({"op": "disable"})
        self._require_effect(lambda now: not now.enabled, "disable", EFFECT_SECONDS)

    def close(self) -> None:
        """End the process; see `ArmDriver`."""
        if self._process is None:
            return
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):  # a process that has died takes no farewell
                self._process.stdin.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None

    @property
    def _stopping(self) -> bool:
        return self._stops != self._stops_ended

    def _require_no_stop(self) -> None:
        if self._stopping:
            raise NotReadyError(f"{self.name}: it was told to stop: reset it, then enable it.")

    def _send(self, request: dict[str, Any], *, moves: bool = False) -> None:
        """Hand a request over without waiting; one that moves something, not after a stop.

        A line is shorter than what a pipe takes as a whole or not at all.
        """
        line = msgspec.json.encode(request) + b"\n"
        with self._lock:
            if moves:
                self._require_no_stop()
            if self._process is None or self._process.stdin is None:
                raise NotConnectedError(f"{self.name}: no PyRobot process: connect first.")
            try:
                os.write(self._process.stdin.fileno(), line)
            except BlockingIOError:
                self._process.kill()
                raise NotConnectedError(
                    f"{self.name}: the PyRobot process does not take commands: it was ended, so that none"
                    " arrives late; connect again."
                ) from None
            except (OSError, ValueError):  # it has died, or is being closed
                reason = f"{self.name}: the PyRobot process has ended: connect again."
                raise NotConnectedError(reason) from None

    def _require_effect(self, shown: Callable[[ArmState], bool], what: str, seconds: float) -> None:
        if not self._wait_for(lambda: shown(self.state()), seconds):
            raise EffectTimeoutError(
                f"{self.name}: {what} shows no effect after {seconds:.0f} s: {why_not_ready(self.state())}."
            )

    def _wait_for(self, condition: Callable[[], bool], seconds: float) -> bool:
        deadline = self._clock.now() + seconds
        while not condition() and self._clock.now() < deadline:
            self._clock.sleep_until(self._clock.now() + POLL_SECONDS)
        return condition()
