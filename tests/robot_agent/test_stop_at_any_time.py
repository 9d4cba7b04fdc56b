"""A stop counts whenever it comes: while arms are made ready or acknowledged, while a link blocks."""

import threading
import time

import pytest
from motions import straight
from recording_arms import HOME, TestBench

from taskschema_robot.errors import NotReadyError
from taskschema_robot.safety.fault import FaultError, FaultKind

STOP_SECONDS = 0.2
"""Issue: both arms are stopped within 200 ms, by the clock on the wall."""


def swing():
    end = HOME.copy()
    end[:, 0] += 0.5
    return straight(HOME, end)


def then_stop(bench, action):
    """Return an action that a stop follows from another thread."""

    def both(*values):
        result = action(*values)
        stopping = threading.Thread(target=bench.gate.stop, args=("a second stop",))
        stopping.start()
        stopping.join()
        return result

    return both


@pytest.mark.parametrize("arm", [0, 1])
@pytest.mark.parametrize("step", ["set_speed_ratio", "reset", "state"])
def test_a_stop_during_an_acknowledgement_is_not_lost(arm, step):
    bench = TestBench()
    bench.gate.stop("the first stop")
    driver = bench.arms[arm]
    setattr(driver, step, then_stop(bench, getattr(driver, step)))
    with pytest.raises(FaultError, match="a second stop"):
        bench.gate.acknowledge("tester")
    delattr(driver, step)
    assert bench.gate.fault.reason == "a second stop"
    assert all(each.stops for each in bench.arms), "it does not stand still"
    with pytest.raises(FaultError, match="a second stop"):
        bench.gate.execute(swing())
    assert bench.sent == 0
    assert [fault.reason for fault in bench.faults][:2] == ["the first stop", "a second stop"]
    bench.gate.acknowledge("tester")
    assert bench.gate.execute(swing()) is None


def test_a_fault_that_cannot_be_cleared_leaves_both_arms_stopped():
    bench = TestBench()
    bench.gate.stop("the first stop")

    def fail() -> None:
        raise NotReadyError("the emergency stop button is pressed")

    bench.arms[1].reset = fail
    with pytest.raises(NotReadyError):
        bench.gate.acknowledge("tester")
    assert bench.gate.fault.reason == "the first stop"
    assert all(arm.stops for arm in bench.arms)


def uncalibrated(bench) -> list[int]:
    """Make both grippers need calibration; return what notes whose was calibrated."""
    noted: list[int] = []
    for index, arm in enumerate(bench.arms):
        gripper = arm.state().gripper
        arm.reset = lambda: None
        arm.changes["gripper"] = type(gripper)(gripper.opening, False, False, False, False)
        arm.calibrate_gripper = lambda index=index: noted.append(index)
    return noted


def test_a_stop_while_grippers_are_calibrated_ends_it():
    bench = TestBench()
    noted = uncalibrated(bench)
    bench.arms[0].calibrate_gripper = then_stop(bench, bench.arms[0].calibrate_gripper)
    with pytest.raises(FaultError, match="a second stop"):
        bench.gate.prepare()
    assert noted == [0]
    assert all(arm.stops for arm in bench.arms)


def test_a_stop_before_the_start_keeps_everything_still():
    bench = TestBench()
    noted = uncalibrated(bench)
    bench.gate.stop("the first stop")
    with pytest.raises(FaultError, match="the first stop"):
        bench.gate.prepare()
    assert not noted


@pytest.mark.parametrize("error", [KeyError("is_moving"), KeyboardInterrupt()])
def test_whatever_ends_a_motion_stops_both_arms(error):
    bench = TestBench()

    def fail() -> None:
        raise error

    bench.clock.after(0.1, fail)
    with pytest.raises(type(error)):
        bench.gate.execute(swing())
    assert all(arm.stops for arm in bench.arms)
    assert bench.gate.fault.kind is FaultKind.AGENT
    sent = bench.sent
    with pytest.raises(FaultError, match="the agent itself failed"):
        bench.gate.execute(swing())
    assert bench.sent == sent


def test_a_stop_does_not_wait_for_a_set_point_that_a_link_does_not_take():
    bench, blocked, freed = TestBench(), threading.Event(), threading.Event()

    def block(positions) -> None:
        blocked.set()
        freed.wait(5.0)

    bench.arms[0].command = block
    faults: list[FaultError] = []

    def move() -> None:
        try:
            bench.gate.execute(swing())
        except FaultError as error:
            faults.append(error)

    moving = threading.Thread(target=move)
    moving.start()
    assert blocked.wait(5.0)
    begin = time.monotonic()
    bench.gate.stop("the stop key")
    assert time.monotonic() - begin < STOP_SECONDS
    assert all(arm.stops for arm in bench.arms)
    freed.set()
    moving.join(5.0)
    assert faults[0].fault.reason == "the stop key"
    assert not bench.arms[1].commands, "a set-point after the stop"
