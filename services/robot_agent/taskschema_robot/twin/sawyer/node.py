"""The robot's ROS node: topics in, topics out."""

from collections.abc import Callable

import numpy as np

from taskschema.arrays import FloatArray
from taskschema_robot import sawyer_interface as interface
from taskschema_robot.twin.ros.graph import RosGraph
from taskschema_robot.twin.ros.message import Message
from taskschema_robot.twin.ros.serialisation import ros_time
from taskschema_robot.twin.sawyer.assembly import Assembly
from taskschema_robot.twin.sawyer.electric_gripper import ElectricGripper
from taskschema_robot.twin.sawyer.joint_control import JointControl
from taskschema_robot.twin.sawyer.measurement import ArmMeasurement

COLLISION_FORCE = 25.0
"""[N] on a link at which the robot's collision detection stops it."""
COLLISION_SECONDS = 0.5
"""For how long a collision is reported after its force has gone."""
STATE_PERIOD = 0.1
"""Between two messages of the states that change seldom [s]; a change is published at once."""
GRIPPER_PERIOD = 0.5
"""Between two messages of a gripper at rest [s]."""
MOVING_GRIPPER_PERIOD = 0.05
OTHER_JOINTS = ("head_pan", "torso_t0")
"""Joints that stand in the joint states beside the arm's."""
LATCHED = (interface.ROBOT_STATE, interface.GRIPPER_CONFIGURATION, interface.END_EFFECTOR_CONFIGURATION)


class SawyerNode:
    """One robot's controllers behind its topics.

    Args:
        graph: the robot's topics.
        control: its joints.
        now: a clock that never jumps [s].
        stamp: the robot's clock, for time stamps [s since the epoch].

    """

    def __init__(
        self, graph: RosGraph, control: JointControl, now: Callable[[], float], stamp: Callable[[], float]
    ) -> None:
        self.assembly = Assembly()
        self.control = control
        self.gripper = ElectricGripper()
        self.collision = False
        self.frozen = False
        """Whether the joint states stand still although the robot goes on: a fault that can be set."""
        self._silent: set[str] = set()
        self._graph = graph
        self._now = now
        self._stamp = stamp
        self._collision_until = float("-inf")
        self._published_state: Message | None = None
        self._published_collision: bool | None = None
        self._next_state = self._next_gripper = float("-inf")
        self._gripper_changed = False
        self._was_enabled = False
        for topic in (interface.JOINT_STATES, interface.ENDPOINT_STATE, interface.COLLISION_STATE):
            graph.advertise(topic, interface.TYPES[topic])
        graph.advertise(interface.GRIPPER_STATE, interface.TYPES[interface.GRIPPER_STATE])
        for topic in LATCHED:
            graph.advertise(topic, interface.TYPES[topic], latch=True)
        commands = {
            interface.JOINT_COMMAND: self._joint_command,
            interface.SPEED_RATIO: self._speed_ratio,
            interface.COMMAND_TIMEOUT: self._timeout,
            interface.ENABLE: lambda message: self.assembly.enable(message["data"]),
            interface.STOP: lambda message: self.assembly.stop(),
            interface.RESET: lambda message: self.assembly.reset(),
            interface.GRIPPER_COMMAND: lambda message: self.gripper.command(message, self._now()),
        }
        for topic, listener in commands.items():
            graph.subscribe(topic, interface.TYPES[topic], listener)
        graph.publish(interface.END_EFFECTOR_CONFIGURATION, self.gripper.node_configuration(stamp()))
        graph.publish(interface.GRIPPER_CONFIGURATION, self.gripper.device_configuration(stamp()))

    def silence(self, topic: str, *, active: bool) -> None:
        """Say nothing any more at a topic, or again: a fault that can be set."""
        (self._silent.add if active else self._silent.discard)(topic)

    def advance(self, seconds: float) -> None:
        """Run the joint controller for one physics step."""
        self.control.advance(seconds, self._now())

    def sense(self, measured: ArmMeasurement, seconds: float) -> None:
        """React to what the sensors say; call at 100 Hz, every `seconds`."""
        now = self._now()
        if measured.contact_force > COLLISION_FORCE:
            if not self.collision:
                self.control.halt()
            self.collision, self._collision_until = True, now + COLLISION_SECONDS
        elif now > self._collision_until:
            self.collision = False
        if self.assembly.enabled != self._was_enabled:
            if self.assembly.enabled:
                self.control.hold(measured.positions)
            else:
                self.control.halt()
            self._was_enabled = self.assembly.enabled
        force, travel = measured.finger_force, measured.finger_travel
        self._gripper_changed |= self.gripper.advance(travel, force, seconds, now)

    def publish(self, measured: ArmMeasurement) -> None:
        """Publish what is due; call at 100 Hz."""
        now = self._now()
        if not self.frozen:
            stamp = self._stamp()
            self._graph.publish_lazily(
                interface.JOINT_STATES, lambda number: _joint_states(measured, _header(stamp, number))
            )
            if interface.ENDPOINT_STATE not in self._silent:
                self._graph.publish_lazily(
                    interface.ENDPOINT_STATE, lambda number: _endpoint_state(measured, _header(stamp, number))
                )
        state = self.assembly.message()
        slow = now >= self._next_state
        if slow:
            self._next_state = now + STATE_PERIOD
        if slow or state != self._published_state:
            self._published_state = state
            self._graph.publish(interface.ROBOT_STATE, dict(state))
        changed = slow or self.collision != self._published_collision
        if changed and interface.COLLISION_STATE not in self._silent:
            self._published_collision = self.collision
            message = {"header": _header(self._stamp()), "collision_state": self.collision}
            self._graph.publish(interface.COLLISION_STATE, message)
        if self._gripper_changed or now >= self._next_gripper:
            self._gripper_changed = False
            self._next_gripper = now + (MOVING_GRIPPER_PERIOD if self.gripper.moving else GRIPPER_PERIOD)
            self._graph.publish(interface.GRIPPER_STATE, self.gripper.state(self._stamp()))

    def _joint_command(self, message: Message) -> None:
        """Take a command; incomplete or not finite, or while the robot is not able, it does nothing."""
        if not self.assembly.enabled or self.collision:
            return
        position = message["mode"] == interface.POSITION_MODE
        if not position and message["mode"] != interface.VELOCITY_MODE:
            return
        values = message["position" if position else "velocity"]
        names = message["names"]
        if len(values) != len(names) or not set(names) <= set(interface.JOINT_NAMES):
            return
        if not np.isfinite(values).all():
            return
        wanted = self.control.goal.copy() if position else np.zeros(len(interface.JOINT_NAMES))
        wanted[[interface.JOINT_NAMES.index(name) for name in names]] = values
        if position:
            self.control.command_positions(wanted)
        else:
            self.control.command_velocities(wanted, self._now())

    def _speed_ratio(self, message: Message) -> None:
        if np.isfinite(message["data"]):
            self.control.speed_ratio = min(max(message["data"], 0.0), 1.0)

    def _timeout(self, message: Message) -> None:
        if np.isfinite(message["data"]):
            self.control.timeout = min(max(message["data"], 0.0), 1.0)


def _header(stamp: float, number: int = 0) -> Message:
    return {"seq": number, "stamp": ros_time(stamp), "frame_id": ""}


def _joint_states(measured: ArmMeasurement, header: Message) -> Message:
    def row(values: FloatArray) -> list[float]:
        return [0.0, *values.tolist(), 0.0]

    head, torso = OTHER_JOINTS
    return {
        "header": header,
        "name": [head, *interface.JOINT_NAMES, torso],
        "position": row(measured.positions),
        "velocity": row(measured.velocities),
        "effort": row(measured.efforts),
    }


def _endpoint_state(measured: ArmMeasurement, header: Message) -> Message:
    w, x, y, z = measured.tool_quaternion.tolist()
    force, torque = measured.wrench[:3].tolist(), measured.wrench[3:].tolist()

    def vector(values: list[float]) -> Message:
        return dict(zip("xyz", values, strict=True))

    zero = vector([0.0, 0.0, 0.0])
    return {
        "header": header | {"frame_id": "base"},
        "pose": {
            "position": vector(measured.tool_position.tolist()),
            "orientation": {"x": x, "y": y, "z": z, "w": w},
        },
        "twist": {"linear": zero, "angular": dict(zero)},
        "wrench": {"force": vector(force), "torque": vector(torque)},
        "valid": True,
    }
