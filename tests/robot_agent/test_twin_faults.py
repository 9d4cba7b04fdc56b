"""Every fault that a twin offers, as the driver and the camera see it."""

import numpy as np
import pytest
from twin_setup import LockStep

from taskschema_robot import sawyer_interface as interface
from taskschema_robot.errors import NotConnectedError, NotReadyError, StaleStateError, TwinError
from taskschema_robot.twin.camera import LockStepCamera
from taskschema_robot.twin.faults import FaultKind


@pytest.fixture
def rig():
    running = LockStep()
    yield running
    running.close()


def test_a_dropped_connection_carries_no_command_and_no_old_state(rig):
    left, right = rig.arms
    rig.client.inject(FaultKind.DROP_CONNECTION, 0)
    rig.sleep(0.05)
    assert not left.connected
    assert right.connected
    goal = rig.running.twin.robots[0].control.goal.copy()
    with pytest.raises(NotConnectedError, match="connect again"):
        left.command(left.state().positions + 0.01)
    left.stop()  # cannot be carried, and does not raise
    left.connect()
    rig.sleep(0.5)
    assert (rig.running.twin.robots[0].control.goal == goal).all()
    assert not left.state().stopped
    left.command(left.state().positions + 0.01)


def test_frozen_states_grow_old_and_stop_the_stream(rig):
    arm = rig.arms[0]
    rig.client.inject(FaultKind.FREEZE_STATE, 0)
    rig.sleep(0.3)
    state = arm.state()
    assert rig.clock.now() - state.time > 0.2
    with pytest.raises(StaleStateError):
        arm.command(state.positions)
    rig.client.inject(FaultKind.FREEZE_STATE, 0, active=False)
    rig.sleep(0.05)
    arm.command(arm.state().positions)


def test_a_lost_acknowledgement_shows(rig):
    arm = rig.arms[0]
    rig.client.inject(FaultKind.LOSE_ACKNOWLEDGEMENT, 0)
    rig.sleep(0.02)
    arm.set_gripper(0.03)
    rig.sleep(1.5)
    assert not arm.gripper_acknowledged
    assert arm.state().gripper.opening == pytest.approx(0.03, abs=0.003)  # it obeyed all the same
    rig.client.inject(FaultKind.LOSE_ACKNOWLEDGEMENT, 0, active=False)
    arm.set_gripper(0.05)
    rig.sleep(0.5)
    assert arm.gripper_acknowledged


def test_a_stop_ends_a_gripper_command_that_is_repeated(rig):
    arm = rig.arms[0]
    came = []
    rig.running.twin.robots[0].bridge.graph.topics[interface.GRIPPER_COMMAND].nodes.append(came.append)
    rig.client.inject(FaultKind.LOSE_ACKNOWLEDGEMENT, 0)
    rig.sleep(0.02)
    arm.set_gripper(0.03)
    rig.sleep(0.5)
    assert len(came) > 2, "it is not repeated"
    arm.stop()
    rig.sleep(0.02)
    before = len(came)
    rig.sleep(0.5)
    with pytest.raises(NotReadyError, match="told to stop"):
        arm.set_gripper(0.05)
    arm.reset()
    arm.enable()
    rig.sleep(0.5)
    assert len(came) == before


@pytest.mark.parametrize(
    ("topic", "change"),
    [
        (interface.GRIPPER_STATE, {"signals": []}),
        (interface.GRIPPER_STATE, {"signals": [{"name": "is_moving", "data": "[]"}]}),
        (interface.GRIPPER_STATE, {"signals": [{"name": "position_response_m", "data": "[NaN]"}]}),
        (interface.GRIPPER_STATE, {"commands": None}),
        (interface.ROBOT_STATE, {"stopped": None}),
        (interface.COLLISION_STATE, {"collision_state": None}),
        (interface.JOINT_STATES, {"name": {}}),
    ],
)
def test_a_malformed_message_counts_as_silence(rig, topic, change):
    """Never as an error in the thread that asks for the state, nor as the end of what is heard."""
    arm, take = rig.arms[0], rig.arms[0]._reports.take
    spoilt: list[str] = []

    def spoil(came: str, message: dict) -> None:
        if came != topic:
            return take(came, message)
        spoilt.append(came)
        if "signals" in change:
            kept = {signal["name"] for signal in change["signals"]}
            rest = [signal for signal in message["signals"] if kept and signal["name"] not in kept]
            return take(came, message | {"signals": rest + change["signals"]})
        return take(came, message | change)

    arm._reports.take = spoil
    rig.sleep(0.1)
    before = arm.state()
    rig.sleep(3.0)
    assert spoilt
    state = arm.state()
    times = {source.name: source.time for source in state.sources} | {interface.JOINT_STATES: state.time}
    assert rig.clock.now() - times.pop(topic) > 2.5
    assert all(rig.clock.now() - time < 2.0 for time in times.values())
    assert state.gripper == before.gripper
    assert not state.stopped


def test_a_stuck_gripper_stays_where_it_is(rig):
    arm = rig.arms[0]
    rig.client.inject(FaultKind.STICK_GRIPPER, 0)
    rig.sleep(0.02)
    before = arm.state().gripper.opening
    arm.set_gripper(0.02)
    rig.sleep(1.0)
    assert arm.gripper_acknowledged
    assert arm.state().gripper.opening == pytest.approx(before, abs=0.003)


def test_a_skewed_clock_shows_as_the_stamps_difference(rig):
    left, right = rig.arms
    rig.client.inject(FaultKind.SKEW_CLOCK, 1, value=-7.5)
    rig.sleep(0.05)
    assert right.state().stamp - right.state().time == pytest.approx(-7.5, abs=0.1)
    assert left.state().stamp - left.state().time == pytest.approx(0.0, abs=0.1)
    assert rig.clock.now() - right.state().time < 0.1  # still fresh


def test_a_joint_error_stops_the_arm_until_reset(rig):
    arm = rig.arms[0]
    rig.client.inject(FaultKind.JOINT_ERROR, 0)
    rig.sleep(0.05)
    assert arm.state().error
    with pytest.raises(NotReadyError, match="error"):
        arm.command(arm.state().positions)
    arm.reset()
    arm.enable()
    assert arm.state().ready


def test_an_obstacle_is_felt_and_stops_the_arm(rig):
    arm = rig.arms[0]
    rig.client.inject(FaultKind.OBSTACLE)
    start = arm.state().positions
    collided = False
    for share in np.linspace(0.0, 1.0, 150):
        goal = start + share * np.array([0.2, 0.15, 0.0, -0.5, 0.0, 0.0, 0.0])  # forwards, between the robots
        if arm.state().collision:
            collided = True
            break
        arm.command(goal)
        rig.sleep(0.01)
    assert collided
    with pytest.raises(NotReadyError, match="collision"):
        arm.command(arm.state().positions)
    rig.sleep(0.2)
    assert np.abs(arm.state().velocities).max() < 0.1


def test_a_frozen_camera_repeats_its_picture(rig):
    camera = LockStepCamera(rig.client, rig.clock)
    rig.sleep(0.1)
    first = camera.latest()
    rig.sleep(0.1)
    assert camera.latest().number > first.number
    rig.client.inject(FaultKind.FREEZE_CAMERA)
    rig.sleep(0.01)
    frozen = camera.latest()
    rig.sleep(0.5)
    assert camera.latest().number == frozen.number
    assert rig.clock.now() - camera.latest().time > 0.45
    rig.client.inject(FaultKind.FREEZE_CAMERA, active=False)
    rig.sleep(0.05)
    assert camera.latest().number > frozen.number


def test_the_twin_refuses_what_makes_no_sense(rig):
    with pytest.raises(TwinError, match="finite numbers"):
        rig.client.place_object(np.zeros(3))
    with pytest.raises(TwinError, match="an arm is 0"):
        rig.client.inject(FaultKind.FREEZE_STATE, 2)
    with pytest.raises(TwinError, match="at a time"):
        rig.client.run(rig.client.advance(rig.clock.now() + 1e9, {}))
