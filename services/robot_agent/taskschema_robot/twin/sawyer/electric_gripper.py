"""The electric gripper as its input/output node shows it: signals, late acknowledgements, calibration."""

import json
from collections import deque
from typing import Any

from taskschema.kinematics.sawyer import GRIPPER_STROKE
from taskschema_robot.twin.ros.message import Message
from taskschema_robot.twin.ros.serialisation import ros_time

ACKNOWLEDGE_SECONDS = 0.25
"""From a command's arrival until its time stands in the state, as the recorded stand-in took."""
CALIBRATION_SECONDS = 1.5
COMMANDS_KEPT = 10
CLOSED_SHARE = 0.02
"""Of the stroke: a set-point below it asks for the full closing force."""
MOVING_SPEED = 0.003
"""[m/s] above which the fingers count as moving."""
AT_GOAL = 0.004
"""[m] from the set-point within which the fingers have arrived: friction stops them short of it."""
AT_CLOSED = 0.0008
"""The same where they press with their full force [m]."""

SIGNALS = {
    "position_m": ("input", "float"),
    "speed_mps": ("input", "float"),
    "calibrate": ("input", "bool"),
    "reboot": ("input", "bool"),
    "position_response_m": ("output", "float"),
    "force_response_n": ("output", "float"),
    "is_calibrated": ("output", "bool"),
    "is_moving": ("output", "bool"),
    "is_gripping": ("output", "bool"),
    "has_error": ("output", "bool"),
}
"""Role and type of each signal."""


class ElectricGripper:
    """Takes commands, acknowledges them later, and says what the fingers do.

    Commands are known by their time: the same time again is a repetition. Until calibrated, the gripper
    ignores everything else.
    """

    def __init__(self) -> None:
        self.target = GRIPPER_STROKE
        """Set-point of the fingers [m]."""
        self.position = GRIPPER_STROKE
        """Measured [m]."""
        self.force = 0.0
        """[N]"""
        self.calibrated = False
        self.error = False
        self.acknowledges = True
        """Whether commands' times reach the state: a fault that can be set."""
        self.moving = False
        self._speed = 0.15
        self._calibrating_until: float | None = None
        self._pending: deque[tuple[float, Message, dict[str, Any]]] = deque()
        self._seen: deque[tuple[int, int]] = deque(maxlen=100)
        self._commands: deque[Message] = deque(maxlen=COMMANDS_KEPT)

    @property
    def closing(self) -> bool:
        """Whether the set-point is fully closed: the fingers then press with their full force."""
        return self.target <= CLOSED_SHARE * GRIPPER_STROKE

    @property
    def gripping(self) -> bool:
        """Whether the fingers stopped on something before their set-point."""
        margin = AT_CLOSED if self.closing else AT_GOAL
        return not self.moving and self.position > self.target + margin and self.calibrated

    def command(self, message: Message, now: float) -> None:
        """Take an IOComponentCommand; one that makes no sense is acknowledged and does nothing."""
        key = (message["time"]["secs"], message["time"]["nsecs"])
        if key in self._seen:
            return
        self._seen.append(key)
        self._pending.append((now + ACKNOWLEDGE_SECONDS, message["time"], _signals(message)))

    def advance(self, position: float, force: float, seconds: float, now: float) -> bool:
        """Take in what the fingers do [m, N]; return whether the state has changed."""
        moving = abs(position - self.position) > MOVING_SPEED * seconds
        changed = moving != self.moving
        self.position, self.force, self.moving = position, force, moving
        if self._calibrating_until is not None:
            self.target = 0.0 if now < self._calibrating_until - 0.5 * CALIBRATION_SECONDS else GRIPPER_STROKE
            if now >= self._calibrating_until:
                self._calibrating_until, self.calibrated, changed = None, True, True
        while self._pending and now >= self._pending[0][0]:
            _, time, signals = self._pending.popleft()
            self._apply(signals, now)
            if self.acknowledges:
                self._commands.append(time)
            changed = True
        return changed

    def _apply(self, signals: dict[str, Any], now: float) -> None:
        if signals.get("reboot") is True:
            self.calibrated = self.error = False
        if signals.get("calibrate") is True:
            self._calibrating_until = now + CALIBRATION_SECONDS
        if not self.calibrated or self.error:
            return
        target = signals.get("position_m")
        if isinstance(target, (int, float)) and not isinstance(target, bool):
            self.target = min(max(float(target), 0.0), GRIPPER_STROKE)
        speed = signals.get("speed_mps")
        if isinstance(speed, (int, float)) and not isinstance(speed, bool):
            self._speed = min(max(float(speed), 0.15), 3.0)

    def state(self, now: float) -> Message:
        """Return intera_core_msgs/IODeviceStatus."""
        values = {
            "position_m": self.target,
            "speed_mps": self._speed,
            "calibrate": self._calibrating_until is not None,
            "reboot": False,
            "position_response_m": self.position,
            "force_response_n": self.force,
            "is_calibrated": self.calibrated,
            "is_moving": self.moving,
            "is_gripping": self.gripping,
            "has_error": self.error,
        }
        signals = [
            {
                "name": name,
                "format": json.dumps({"role": role, "type": kind}),
                "data": f"[ {json.dumps(values[name])} ]",
                "status": _ready(),
            }
            for name, (role, kind) in SIGNALS.items()
        ]
        return {
            "time": ros_time(now),
            "device": {"name": "right_gripper", "status": _ready()},
            "ports": [],
            "signals": signals,
            "commands": list(self._commands),
            "responses": [],
        }

    @staticmethod
    def node_configuration(now: float) -> Message:
        """Return intera_core_msgs/IONodeConfiguration: which devices there are."""
        properties = json.dumps({"props": {"device": "electric_gripper"}})
        return {
            "time": ros_time(now),
            "node": {"name": "end_effector", "config": "{}"},
            "devices": [{"name": "right_gripper", "config": properties}],
            "plugins": [],
        }

    @staticmethod
    def device_configuration(now: float) -> Message:
        """Return intera_core_msgs/IODeviceConfiguration: which signals there are."""
        return {
            "time": ros_time(now),
            "commanded": "{}",
            "upgraded": "{}",
            "device": {"name": "right_gripper", "config": json.dumps({"params": {}})},
            "ports": [],
            "signals": [
                {"name": name, "config": json.dumps({"role": role, "type": kind})}
                for name, (role, kind) in SIGNALS.items()
            ],
        }


def _ready() -> Message:
    return {"tag": "ready", "id": "", "detail": "{}"}


def _signals(message: Message) -> dict[str, Any]:
    """Return the signals that a command sets, by name; none if it cannot be read."""
    if message["op"] != "set":
        return {}
    try:
        signals = json.loads(message["args"])["signals"]
        return {name: signal["data"][0] for name, signal in signals.items()}
    except (ValueError, LookupError, TypeError, AttributeError):
        return {}
