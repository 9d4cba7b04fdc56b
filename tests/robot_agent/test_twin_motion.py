"""The rosbridge driver on the twin in lock-step: motion, switches, gripper."""

import numpy as np
import pytest
from twin_setup import EPOCH, LockStep

from taskschema.kinematics.sawyer import sawyer
from taskschema_robot.errors import EffectTimeoutError, NotReadyError, SetpointError
from taskschema_robot.twin.faults import FaultKind
from taskschema_robot.twin.twin import FINGER_MOUNT

NUDGE = np.array([0.25, 0.1, -0.1, 0.1, 0.2, 0.2, 0.4])


@pytest.fixture
def rig():
    running = LockStep()
    yield running
    running.close()


def test_streamed_set_points_arrive(rig):
    left, right = rig.arms
    goal = left.state().positions + NUDGE
    rest = right.state().positions
    rig.stream(left, goal, 1.5)
    rig.sleep(0.4)
    assert np.abs(left.state().positions - goal).max() < 0.005
    assert np.abs(left.state().velocities).max() < 0.01
    assert np.abs(right.state().positions - rest).max() < 1e-3


def test_a_run_is_a_function_of_its_commands():
    def run() -> list[bytes]:
        rig = LockStep()
        try:
            kept = []
            for arm, sign in zip(rig.arms, (1.0, -1.0), strict=True):
                rig.stream(arm, arm.state().positions + sign * NUDGE, 0.6)
                arm.set_gripper(0.02)
            rig.sleep(0.8)
            for arm in rig.arms:
                state = arm.state()
                kept += [state.positions.tobytes(), state.wrench.tobytes(), repr(state.gripper).encode()]
            return [*kept, rig.client.object_pose().tobytes(), repr(rig.clock.now()).encode()]
        finally:
            rig.close()

    assert run() == run()


def test_the_clock_is_the_twins(rig):
    assert EPOCH < rig.clock.now() < EPOCH + 10
    before = rig.clock.now()
    rig.sleep(1.23)
    assert rig.clock.now() == pytest.approx(before + 1.23, abs=0.006)
    assert rig.clock.now() - rig.arms[0].state().time <= 0.06


def test_the_speed_ratio_limits_the_arm(rig):
    arm = rig.arms[0]
    arm.set_speed_ratio(0.1)
    rig.sleep(0.05)
    target = arm.state().positions.copy()
    target[0] += 0.1
    arm.command(target)
    speeds = []
    for _ in range(60):
        rig.sleep(0.01)
        speeds.append(abs(arm.state().velocities[0]))
    assert 0.8 * 0.174 < max(speeds) < 1.1 * 0.174  # 0.1 of 1.74 rad/s


def test_in_position_mode_a_move_goes_on_without_commands(rig):
    # What the vendor's simulator does too, and why set-points stay within stopping distance.
    arm = rig.arms[0]
    target = arm.state().positions.copy()
    target[0] += 0.1
    arm.command(target)
    rig.sleep(1.0)
    assert arm.state().positions[0] == pytest.approx(target[0], abs=0.003)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ((0, 0.2), "farther from the last set-point"),  # 1.74^2 / (2 * 10) = 0.151 rad
        ((1, 4.0), "outside the joint's limits"),
        ((3, np.nan), "finite"),
        ((5, np.inf), "finite"),
    ],
)
def test_set_points_that_may_not_be_sent(rig, change, reason):
    arm = rig.arms[0]
    wanted = arm.state().positions.copy()
    wanted[change[0]] += change[1]
    before = rig.running.twin.robots[0].control.goal.copy()
    with pytest.raises(SetpointError, match=reason):
        arm.command(wanted)
    rig.sleep(0.1)
    assert (rig.running.twin.robots[0].control.goal == before).all()


def test_each_set_point_is_compared_with_the_last(rig):
    arm = rig.arms[0]
    positions = arm.state().positions
    step = 0.9 * (sawyer().velocity ** 2 / (2 * sawyer().acceleration))
    arm.command(positions + step)
    arm.command(positions)
    with pytest.raises(SetpointError, match="farther from the last"):
        arm.command(positions + 1.2 * step)


def test_stop_reset_enable(rig):
    arm = rig.arms[0]
    goal = arm.state().positions + NUDGE
    start = arm.state().positions
    for share in np.linspace(0.0, 0.5, 50):
        arm.command(start + share * (goal - start))
        rig.sleep(0.01)
    arm.stop()
    with pytest.raises(NotReadyError):
        arm.command(goal)
    rig.sleep(0.2)
    state = arm.state()
    assert state.stopped
    assert not state.enabled
    assert np.abs(state.velocities).max() < 0.02  # at rest within 200 ms
    where = state.positions
    with pytest.raises(EffectTimeoutError, match="it is stopped"):
        arm.enable()
    arm.reset()
    assert not arm.state().stopped
    assert not arm.state().enabled  # reset leaves the arm disabled
    with pytest.raises(NotReadyError, match="not enabled"):
        arm.command(where)
    arm.enable()
    rig.stream(arm, where + 0.05, 0.3)
    rig.sleep(0.3)
    assert np.abs(arm.state().positions - where - 0.05).max() < 0.01


def test_the_emergency_stop_must_be_released_before_a_reset(rig):
    arm = rig.arms[1]
    rig.client.inject(FaultKind.PRESS_EMERGENCY_STOP, 1)
    rig.sleep(0.05)
    assert arm.state().stopped
    assert arm.state().emergency_stop
    assert not rig.arms[0].state().stopped
    with pytest.raises(NotReadyError, match="release it first"):
        arm.reset()
    rig.client.inject(FaultKind.PRESS_EMERGENCY_STOP, 1, active=False)
    rig.sleep(0.15)
    assert arm.state().stopped
    arm.reset()
    arm.enable()
    assert arm.state().ready


def test_the_gripper_moves_and_acknowledges_late(rig):
    arm = rig.arms[0]
    assert arm.state().gripper.opening == pytest.approx(FINGER_MOUNT + 0.041667, abs=1e-4)
    arm.set_gripper(FINGER_MOUNT + 0.02)
    rig.sleep(0.2)
    assert not arm.gripper_acknowledged
    rig.sleep(0.2)
    assert arm.gripper_acknowledged
    rig.sleep(0.8)
    assert arm.state().gripper.opening == pytest.approx(FINGER_MOUNT + 0.02, abs=0.003)
    assert not arm.state().gripper.gripping


def test_a_gripper_must_be_calibrated(rig):
    arm = rig.arms[0]
    rig.running.twin.robots[0].node.gripper.calibrated = False
    rig.sleep(0.6)
    with pytest.raises(NotReadyError, match="calibrate"):
        arm.set_gripper(0.03)
    arm.calibrate_gripper()
    assert arm.state().gripper.calibrated
    arm.set_gripper(0.03)
    rig.sleep(1.0)
    assert arm.state().gripper.opening == pytest.approx(0.03, abs=0.003)


def test_an_opening_out_of_reach_is_the_nearest_end(rig):
    arm = rig.arms[0]
    arm.set_gripper(0.2)
    rig.sleep(0.6)
    assert rig.running.twin.robots[0].node.gripper.target == pytest.approx(0.041667)
