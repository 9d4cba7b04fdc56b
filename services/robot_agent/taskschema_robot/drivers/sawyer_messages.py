"""What a Sawyer's topics say, and how commands to it read."""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskschema.arrays import FloatArray
from taskschema_robot import sawyer_interface as interface

Json = dict[str, Any]
NANOSECONDS = 10**9


@dataclass(frozen=True, eq=False)
class JointReading:
    """One sensor_msgs/JointState, the arm's joints in order."""

    stamp: float
    """[s since the epoch] on the robot's clock."""
    positions: FloatArray
    velocities: FloatArray
    efforts: FloatArray


def read_joint_states(message: Json) -> JointReading:
    """Read joint states; joints are looked up by name, as others may be in the message.

    Raises:
        ValueError: if a joint is missing, or a number: the bridge sends null for one that is not finite.
    """
    names = message["name"]
    order = [names.index(name) for name in interface.JOINT_NAMES]

    def row(key: str) -> FloatArray:
        values = message[key]
        return _finite([values[index] for index in order] if values else [0.0] * len(order))

    stamp = message["header"]["stamp"]
    positions = row("position")
    return JointReading(read_time(stamp), positions, row("velocity"), row("effort"))


def read_wrench(message: Json) -> FloatArray:
    """Return the force [N] and torque [Nm] at the end effector, [6]; see `read_joint_states` for errors."""
    wrench = message["wrench"]
    return _finite([wrench[part][axis] for part in ("force", "torque") for axis in "xyz"])


def read_time(stamp: Json) -> float:
    """Return a ROS time in seconds."""
    return float(stamp["secs"]) + float(stamp["nsecs"]) / NANOSECONDS


def _finite(values: list[Any]) -> FloatArray:
    if None in values:
        raise ValueError("a number is not finite")
    return np.array(values, dtype=np.float64)


def read_signals(message: Json) -> Json:
    """Return the values of an input/output device's signals by name."""
    values = {}
    for signal in message["signals"]:
        data = json.loads(signal["data"])
        values[signal["name"]] = data[0] if data else None
    return values


def joint_command(positions: FloatArray) -> Json:
    """Return the JointCommand of a set-point; the empty header gets the bridge's clock."""
    return {
        "header": {},
        "mode": interface.POSITION_MODE,
        "names": list(interface.JOINT_NAMES),
        "position": positions.tolist(),
    }


def signal_command(name: str, value: float | bool, moment: float) -> Json:
    """Return the IOComponentCommand that sets a gripper's signal; its time is what it is known by."""
    kind = "bool" if isinstance(value, bool) else "float"
    arguments = {"signals": {name: {"format": {"type": kind}, "data": [value]}}}
    seconds, rest = divmod(round(moment * NANOSECONDS), NANOSECONDS)
    return {"time": {"secs": seconds, "nsecs": rest}, "op": "set", "args": json.dumps(arguments)}
