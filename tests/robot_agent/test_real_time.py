"""The rosbridge driver on the twin in real time: clocks, pings, broken and stalled connections."""

import contextlib
import time

import numpy as np
import pytest
from twin_setup import RunningTwin, arm_of

from taskschema_robot.clock import RealClock
from taskschema_robot.drivers.rosbridge import RosbridgeAddress, RosbridgeArm
from taskschema_robot.errors import NotConnectedError, StaleStateError
from taskschema_robot.twin.client import TwinClient
from taskschema_robot.twin.faults import FaultKind
from taskschema_robot.twin.twin import TwinOptions


@pytest.fixture
def rig():
    running = RunningTwin(TwinOptions(calibrated=True))
    clock = RealClock()
    arm = arm_of(running, 0, clock)
    client = TwinClient(running.control_url)
    arm.connect()
    arm.set_speed_ratio(1.0)
    arm.enable()
    yield running, client, arm, clock
    arm.close()
    client.close()
    running.close()


def wait_until(condition, seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def stream(arm, positions: np.ndarray) -> None:
    """Send a set-point, unless this busy machine has kept the states waiting."""
    with contextlib.suppress(StaleStateError):
        arm.command(positions)


def test_states_come_and_set_points_arrive(rig):
    _, _, arm, clock = rig
    start = arm.state().positions
    goal = start + 0.1
    begin = clock.now()
    for step in range(1, 101):
        stream(arm, start + step / 100 * (goal - start))
        clock.sleep_until(begin + 0.01 * step)

    def arrived() -> bool:
        stream(arm, goal)
        return bool(np.abs(arm.state().positions - goal).max() < 0.01)

    wait_until(arrived)
    assert arm.state().enabled
    assert abs(arm.state().stamp - arm.state().time) < 1.0


def test_nothing_sent_to_a_broken_connection_comes_out_of_a_new_one(rig):
    running, client, arm, clock = rig
    control = running.twin.robots[0].control
    received = []
    topic = running.twin.robots[0].bridge.graph.topics["/robot/limb/right/joint_command"]
    topic.nodes.append(received.append)
    start = arm.state().positions
    arm.command(start)
    wait_until(lambda: received)
    client.inject(FaultKind.DROP_CONNECTION, 0)
    refused = sent = 0
    for step in range(50):  # an agent that has not noticed goes on commanding
        try:
            arm.command(start + 0.001 * step)
            sent += 1
        except (NotConnectedError, StaleStateError):
            refused += 1
        time.sleep(0.005)
    assert refused > 30
    arrived = len(received)
    assert arrived <= 1 + sent
    goal = control.goal.copy()
    arm.connect()
    clock.sleep_until(clock.now() + 1.0)
    assert len(received) == arrived  # nothing stale was delivered
    assert (control.goal == goal).all()

    def commanded() -> bool:
        stream(arm, arm.state().positions)
        return len(received) > arrived

    wait_until(commanded)


def test_a_stalled_connection_is_found_by_its_age_and_by_pings(rig):
    _, client, arm, clock = rig
    client.inject(FaultKind.STALL_CONNECTION, 0)
    wait_until(lambda: clock.now() - arm.state().time > 0.1, 1.0)
    with pytest.raises(StaleStateError):
        arm.command(arm.state().positions)
    wait_until(lambda: not arm.connected, 4.0)  # two missing pongs: 1.5 s
    client.inject(FaultKind.STALL_CONNECTION, 0, active=False)
    arm.connect()
    stream(arm, arm.state().positions)
    assert arm.connected


def test_a_robot_that_is_not_there():
    arm = RosbridgeArm("left", RosbridgeAddress("ws://127.0.0.1:9", 0.0141), RealClock())
    with pytest.raises(NotConnectedError, match="No rosbridge at ws://127.0.0.1:9"):
        arm.connect()
    with pytest.raises(NotConnectedError, match="no state yet"):
        arm.state()
    arm.stop()
    arm.close()


def test_a_bridge_without_a_robot_is_named(rig):
    running, client, arm, clock = rig
    client.inject(FaultKind.FREEZE_STATE, 0)
    with pytest.raises(NotConnectedError, match="nothing comes from /robot/joint_states"):
        arm.connect()


def test_stop_acts_within_the_time(rig):
    running, _, arm, clock = rig
    start = arm.state().positions
    for step in range(1, 60):
        stream(arm, start + 0.005 * step * np.array([1, 0, 0, 0, 0, 0, 1]))
        time.sleep(0.01)
    begin = clock.now()
    arm.stop()
    wait_until(lambda: arm.state().stopped and np.abs(arm.state().velocities).max() < 0.02, 5.0)
    # 200 ms are what the robot may take; a busy test machine may take its own time to notice.
    assert clock.now() - begin < 1.0
