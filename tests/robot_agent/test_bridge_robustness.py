"""Whatever a client sends, the twin's bridge goes on and the robot stays within its limits."""

import json
import math

import msgspec
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from taskschema.kinematics.sawyer import sawyer
from taskschema_robot import sawyer_interface as interface
from taskschema_robot.twin.ros.bridge import Bridge
from taskschema_robot.twin.ros.graph import RosGraph
from taskschema_robot.twin.ros.message import MessageError, read_message
from taskschema_robot.twin.ros.serialisation import ros_time, serialise
from taskschema_robot.twin.ros.session import BridgeSession, FragmentStore
from taskschema_robot.twin.sawyer.joint_control import JointControl
from taskschema_robot.twin.sawyer.node import SawyerNode

NEUTRAL = np.array([0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161])
NOW = ros_time(1_800_000_000.25)


class Rig:
    """A robot's node, its bridge and one client, without sockets."""

    def __init__(self) -> None:
        self.time = 1_800_000_000.0
        graph = RosGraph()
        self.control = JointControl(sawyer(), NEUTRAL)
        self.node = SawyerNode(graph, self.control, lambda: self.time, lambda: self.time)
        self.node.assembly.enable(True)
        self.logged: list[str] = []
        self.sent: list[str] = []
        log = lambda level, message: self.logged.append(f"{level} {message}")  # noqa: E731
        self.bridge = Bridge(graph, lambda: self.time, link_delay=0.0, log=log)
        send = lambda frame, keep: self.sent.append(frame)  # noqa: E731
        self.session = BridgeSession(0, self.bridge, FragmentStore(), send)

    def advance(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.005)):
            self.time += 0.005
            self.node.advance(0.005)
            self.bridge.tick()


leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12)
values = st.recursive(
    leaves,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)
operations = st.fixed_dictionaries(
    {},
    optional={
        "op": st.sampled_from(
            ["publish", "advertise", "unadvertise", "subscribe", "unsubscribe", "fragment", "status", 5]
        ),
        "topic": st.sampled_from([*interface.TYPES, "/x", 7]) | values,
        "type": st.sampled_from([*interface.TYPES.values(), "std_msgs/Nope", "odd"]) | values,
        "msg": values | st.fixed_dictionaries({"data": values}),
        "id": leaves,
        "throttle_rate": leaves,
        "queue_length": leaves,
        "fragment_size": leaves,
        "num": leaves,
        "total": leaves,
        "data": leaves,
    },
)


@settings(max_examples=40)
@given(st.lists(operations | values, max_size=12), st.text(max_size=30))
def test_no_frame_disturbs_the_bridge(messages, garbage):
    rig = Rig()
    for message in messages:
        rig.session.incoming(json.dumps(message))
    rig.session.incoming(garbage)
    rig.advance(0.05)
    assert np.isfinite(rig.control.reference).all()
    assert rig.control.speed_ratio <= 1.0


angles = st.floats() | st.integers(-10, 10) | st.none()
commands = st.fixed_dictionaries(
    {
        "mode": st.integers(-1, 6),
        "names": st.lists(st.sampled_from([*interface.JOINT_NAMES, "head_pan"]), max_size=8),
        "position": st.lists(angles, max_size=8),
        "velocity": st.lists(angles, max_size=8),
    }
)


@given(st.lists(commands, min_size=1, max_size=6))
def test_no_joint_command_leaves_the_limits(messages):
    rig = Rig()
    arm = sawyer()
    before = rig.control.reference.copy()
    for message in messages:
        operation = {"op": "publish", "topic": interface.JOINT_COMMAND, "msg": message}
        rig.session.incoming(json.dumps(operation))
        for _ in range(10):
            rig.advance(0.005)
            now = rig.control.reference
            assert (now >= arm.lower).all()
            assert (now <= arm.upper).all()
            assert (np.abs(now - before) <= arm.velocity * 0.005 + 1e-9).all()
            before = now.copy()


@settings(max_examples=40)
@given(st.dictionaries(st.sampled_from(["data", "layout", "header"]), values))
@example({"data": "\x80"})
def test_what_is_read_can_be_serialised_or_is_refused(fields):
    for kind in ("std_msgs/UInt8MultiArray", "std_msgs/Float32", "std_msgs/Time", "std_msgs/String"):
        try:
            message = serialise(kind, read_message(kind, fields, NOW))
        except MessageError:
            continue
        json.loads(msgspec.json.encode(message))


def test_a_goal_is_reached_at_rest_without_overshoot():
    rig = Rig()
    rig.control.speed_ratio = 1.0
    goal = NEUTRAL + 0.4
    rig.control.command_positions(goal)
    highest = np.full(7, -math.inf)
    for _ in range(400):
        rig.advance(0.005)
        highest = np.maximum(highest, rig.control.reference)
    assert rig.control.reference == pytest.approx(goal, abs=1e-4)
    assert (highest <= goal + 1e-4).all()
    assert rig.control.velocity == pytest.approx(np.zeros(7), abs=1e-3)


def test_velocity_mode_ends_with_its_commands():
    rig = Rig()
    message = {"mode": 2, "names": ["right_j0"], "velocity": [0.5]}
    rig.session.incoming(json.dumps({"op": "publish", "topic": interface.JOINT_COMMAND, "msg": message}))
    rig.advance(0.15)
    assert rig.control.velocity[0] == pytest.approx(0.5)
    rig.advance(0.5)  # the time-out is 0.2 s
    assert rig.control.velocity[0] == pytest.approx(0.0, abs=1e-6)


def test_a_burst_back_to_back_arrives_in_order():
    rig = Rig()
    received = []
    rig.bridge.graph.topics[interface.JOINT_COMMAND].nodes.append(received.append)
    for index in range(500):
        message = {"mode": 1, "names": ["right_j0"], "position": [0.001 * index]}
        rig.session.incoming(json.dumps({"op": "publish", "topic": interface.JOINT_COMMAND, "msg": message}))
    assert [message["position"][0] for message in received] == [0.001 * index for index in range(500)]


def test_a_slow_reader_without_a_queue_silences_the_topic_for_all():
    # As recorded with a genuine bridge, scenarios 13c and 13d; the driver therefore asks for a queue of 1.
    rig = Rig()
    slow = BridgeSession(1, rig.bridge, FragmentStore(), lambda frame, keep: None, lambda: True)
    topic = interface.SPEED_RATIO

    def publish() -> int:
        before = len(rig.sent)
        rig.session.incoming(json.dumps({"op": "publish", "topic": topic, "msg": {"data": 0.5}}))
        return len(rig.sent) - before

    rig.session.incoming(json.dumps({"op": "subscribe", "topic": topic}))
    assert publish() == 1
    slow.incoming(json.dumps({"op": "subscribe", "topic": topic, "queue_length": 0}))
    assert publish() == 0
    slow.incoming(json.dumps({"op": "subscribe", "topic": topic, "queue_length": 1}))
    assert publish() == 1
