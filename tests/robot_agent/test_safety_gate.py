"""The gate during and after a motion: a fault stops both arms in time, latches, and ends with a person."""

from dataclasses import replace

import numpy as np
import pytest
from motions import PERIOD, grasp_of_the_bar, skill_motion, straight
from recording_arms import HOME, RecordingArm, TestBench

from taskschema.kinematics.sawyer import rethink_gripper, sawyer
from taskschema.safety.limits import SafetyLimits
from taskschema_robot.drivers.driver import Source
from taskschema_robot.errors import NotReadyError, SetpointError
from taskschema_robot.safety.fault import Fault, FaultError, FaultKind, RecoveryError
from taskschema_robot.safety.homing import return_home

STOP_SECONDS = 0.2
"""Issue: both arms are stopped within 200 ms of a fault."""
OPEN = np.full(2, rethink_gripper().open)


def swing() -> np.ndarray:
    end = HOME.copy()
    end[:, 0] += 0.5
    return end


def test_set_points_are_those_that_were_checked_at_their_period():
    bench, motion = TestBench(), grasp_of_the_bar()
    assert bench.gate.execute(motion) is None
    for index, arm in enumerate(bench.arms):
        times = np.array([time for time, _ in arm.commands])
        sent = np.stack([positions for _, positions in arm.commands])
        np.testing.assert_array_equal(sent[: len(motion)], motion.joints[index])
        np.testing.assert_allclose(np.diff(times), PERIOD, atol=1e-9)
        np.testing.assert_array_equal(sent[-1], motion.joints[index, -1])


def test_grippers_are_set_when_they_change():
    bench, motion = TestBench(), grasp_of_the_bar()
    bench.gate.execute(motion)
    assert [arm.opening for arm in bench.arms] == [rethink_gripper().closed] * 2


def silence(arm: RecordingArm) -> None:
    arm.frozen_at = arm.state().time


def hush(arm: RecordingArm) -> None:
    arm.changes["sources"] = (Source("/its/wrench", arm.state().time, 0.1),)


def hold_back(arm: RecordingArm) -> None:
    arm.follows = False


def disconnect(arm: RecordingArm) -> None:
    arm.connected = False


def say(**changes):
    return lambda arm: arm.changes.update(changes)


def refuse(error: Exception):
    def apply(arm: RecordingArm) -> None:
        arm.refuses = error

    return apply


def gripper_error(arm: RecordingArm) -> None:
    arm.changes["gripper"] = replace(arm.state().gripper, error=True)


@pytest.mark.parametrize("arm", [0, 1])
@pytest.mark.parametrize(
    ("breaks", "kind"),
    [
        (silence, FaultKind.STATE_AGE),
        (hush, FaultKind.STATE_AGE),
        (hold_back, FaultKind.TRACKING),
        (disconnect, FaultKind.CONNECTION),
        (say(collision=True), FaultKind.COLLISION),
        (say(enabled=False), FaultKind.NOT_ENABLED),
        (say(stopped=True), FaultKind.STOPPED),
        (say(emergency_stop=True, stopped=True), FaultKind.EMERGENCY_STOP),
        (say(error=True), FaultKind.ROBOT_ERROR),
        (say(wrench=np.array([0, 100.0, 0, 0, 0, 0])), FaultKind.WRENCH),
        (say(wrench=np.array([0, 0, 0, 0, 20.0, 0])), FaultKind.WRENCH),
        (say(positions=np.full(7, np.nan)), FaultKind.STATE_AGE),
        (gripper_error, FaultKind.GRIPPER),
        (refuse(NotReadyError("not enabled")), FaultKind.COMMAND),
        (refuse(SetpointError("too far")), FaultKind.COMMAND),
    ],
)
def test_every_fault_of_either_arm_stops_both_in_time(arm, breaks, kind):
    bench = TestBench()
    began = bench.clock.now() + 0.2
    bench.clock.after(0.2, lambda: breaks(bench.arms[arm]))
    with pytest.raises(FaultError) as error:
        bench.gate.execute(straight(HOME, swing(), speed_ratio=0.5))
    assert error.value.fault.kind is kind
    allowed = STOP_SECONDS if kind is not FaultKind.TRACKING else 0.5  # it has to build up first
    for driver in bench.arms:
        assert driver.stops, "not told to stop"
        assert driver.stops[0] - began <= allowed
        last = max((time for time, _ in driver.commands), default=0.0)
        assert last <= driver.stops[0], "a set-point after the stop"
    assert bench.faults == [error.value.fault]


def test_a_fault_latches_until_a_person_acknowledges_it():
    bench = TestBench()
    bench.gate.stop("the stop key")
    sent = bench.sent
    for _ in range(2):
        with pytest.raises(FaultError, match="the stop key"):
            bench.gate.execute(straight(HOME, swing()))
    assert bench.sent == sent
    bench.gate.acknowledge("tester")
    assert bench.gate.fault is None
    assert bench.gate.execute(straight(HOME, swing())) is None


def test_a_fault_that_is_still_there_latches_again():
    bench = TestBench()
    bench.arms[0].changes["enabled"] = False
    with pytest.raises(FaultError, match="not enabled"):
        bench.gate.execute(straight(HOME, swing()))
    bench.gate.acknowledge("tester")  # enables it
    bench.arms[1].changes["emergency_stop"] = True
    with pytest.raises(FaultError, match="emergency stop"):
        bench.gate.execute(straight(HOME, swing()))
    assert bench.sent == 0


def test_the_first_fault_is_the_one_that_is_shown():
    bench = TestBench()
    bench.gate.stop("first")
    bench.gate.stop("second")
    assert bench.gate.fault.reason == "first"
    assert len(bench.faults) == 1


class Watched:
    """A monitor that finds something wrong from a moment on."""

    def __init__(self, moment: float, guards_recovery: bool = False) -> None:
        self.moment = moment
        self.guards_recovery = guards_recovery

    def fault(self, now: float) -> Fault | None:
        return Fault(FaultKind.CAMERA, "no frame", now) if now >= self.moment else None


def test_monitors_stop_a_motion_and_keep_one_from_beginning():
    bench = TestBench(monitors=[Watched(1000.1)])
    with pytest.raises(FaultError, match="no frame"):
        bench.gate.execute(straight(HOME, swing()))
    assert all(arm.stops[0] - 1000.1 <= STOP_SECONDS for arm in bench.arms)
    early = TestBench(monitors=[Watched(0.0)])
    with pytest.raises(FaultError):
        early.gate.execute(straight(HOME, swing()))
    assert early.sent == 0


def test_the_way_home_needs_neither_camera_nor_redis_but_whoever_guards_it():
    bench = TestBench(monitors=[Watched(0.0)])
    assert bench.gate.execute(straight(HOME, swing()), recovering=True) is None
    assert bench.sent
    with pytest.raises(FaultError, match="no frame"):
        bench.gate.execute(straight(swing(), HOME))
    guarded = TestBench(monitors=[Watched(0.0, guards_recovery=True)])
    with pytest.raises(FaultError, match="no frame"):
        guarded.gate.execute(straight(HOME, swing()), recovering=True)


def test_an_arm_that_does_not_arrive():
    bench = TestBench(limits=SafetyLimits(tracking_error=1.0))
    bench.arms[0].follows = False
    end = HOME.copy()
    end[0, 0] += 0.06
    with pytest.raises(FaultError, match="short of the end"):
        bench.gate.execute(straight(HOME, end))


def test_a_gripper_that_does_not_acknowledge():
    bench = TestBench()
    bench.arms[1].acknowledges = False
    with pytest.raises(FaultError, match="right gripper"):
        bench.gate.execute(grasp_of_the_bar())


@pytest.mark.parametrize("arm", [0, 1])
def test_a_gripper_that_sticks_open(arm):
    bench = TestBench()
    bench.arms[arm].stuck = True
    with pytest.raises(FaultError, match="gripper has not done what it was told"):
        bench.gate.execute(grasp_of_the_bar())


def test_a_stall_slows_the_motion_and_a_long_one_stops_it():
    bench, motion = TestBench(), straight(HOME, swing())
    bench.clock.after(0.2, lambda: bench.clock.sleep_until(bench.clock.time + 0.05))
    bench.gate.execute(motion)
    times = np.array([time for time, _ in bench.arms[0].commands])
    assert np.diff(times).min() > 0.4 * PERIOD, "a burst"
    assert np.diff(times).max() < 0.07
    halted = TestBench()
    halted.clock.after(0.2, lambda: halted.clock.sleep_until(halted.clock.time + 0.3))
    with pytest.raises(FaultError) as error:
        halted.gate.execute(motion)
    assert error.value.fault.kind in (FaultKind.LATE, FaultKind.STATE_AGE)


def test_the_way_home_is_slow_and_checked():
    bench = TestBench()
    assert bench.gate.execute(grasp_of_the_bar()) is None
    bench.gate.stop("test")
    bench.gate.acknowledge("tester")
    begun = len(bench.arms[0].commands)
    return_home(bench.gate, HOME, OPEN, period=PERIOD, speed_ratio=0.1, recovering=True)
    np.testing.assert_allclose(bench.positions(), HOME, atol=1e-6)
    commands = np.stack([positions for _, positions in bench.arms[0].commands[begun:]])
    assert (np.abs(np.diff(commands, axis=0)) / PERIOD <= 0.1 * sawyer().velocity + 1e-9).all()


def test_arms_that_touch_may_part_but_not_press_on():
    bench = TestBench()
    bench.gate.execute(grasp_of_the_bar())
    tight = SafetyLimits(arm_clearance=0.17)
    stuck = TestBench(bench.positions(), tight)
    assert stuck.gate.check(straight(bench.positions(), HOME)) is not None
    return_home(stuck.gate, HOME, OPEN, period=PERIOD, speed_ratio=0.5, recovering=True)
    np.testing.assert_allclose(stuck.positions(), HOME, atol=1e-6)
    again = TestBench(bench.positions(), tight)
    closer = skill_motion(HOME, ("top_grasp", "top_grasp"), ([0, 0, 2.4], [0, 0, 2.4])).joints[:, -1]
    with pytest.raises(RecoveryError, match="cuff"):
        return_home(again.gate, closer, OPEN, period=PERIOD, speed_ratio=0.5, recovering=True)


def home_from_too_near(limits: SafetyLimits, monitors=(), wrench=()) -> TestBench:
    """Without any fault, arms go home from where they grasp, which these limits call too near."""
    posed = TestBench()
    posed.gate.execute(grasp_of_the_bar())
    bench = TestBench(posed.positions(), limits, monitors)
    bench.arms[0].changes.update(wrench)
    assert bench.gate.check(straight(bench.positions(), HOME)) is not None
    return_home(bench.gate, HOME, OPEN, period=PERIOD, speed_ratio=0.5)
    return bench


def test_without_a_fault_arms_part_under_all_monitors_and_limits():
    tight = SafetyLimits(arm_clearance=0.15)
    bench = home_from_too_near(tight)
    np.testing.assert_allclose(bench.positions(), HOME, atol=1e-6)
    with pytest.raises(FaultError, match="no frame"):
        home_from_too_near(tight, [Watched(0.0)])
    with pytest.raises(FaultError, match="90 N"):
        home_from_too_near(tight, wrench={"wrench": np.array([0, 0, 90.0, 0, 0, 0])})


def test_without_a_fault_arms_never_come_nearer_a_person_is_asked_first():
    with pytest.raises(FaultError, match="find no safe way home") as error:
        home_from_too_near(SafetyLimits(arm_clearance=0.17))
    assert "17.0 cm is the least" in error.value.fault.reason


def test_an_arm_that_is_pressed_against_something_may_leave_it():
    bench = TestBench()
    bench.arms[0].changes["wrench"] = np.array([0.0, 0.0, 300.0, 0.0, 0.0, 0.0])
    with pytest.raises(FaultError, match="force"):
        bench.gate.execute(straight(HOME, swing()))
    bench.gate.acknowledge("tester")
    bench.arms[0].changes["wrench"] = np.array([0.0, 0.0, 300.0, 0.0, 0.0, 0.0])
    assert bench.gate.execute(straight(HOME, swing()), recovering=True) is None
    bench.clock.after(0.1, lambda: bench.arms[0].changes.update(wrench=np.array([0, 0, 400.0, 0, 0, 0])))
    with pytest.raises(FaultError, match="400 N"):
        bench.gate.execute(straight(swing(), HOME), recovering=True)
