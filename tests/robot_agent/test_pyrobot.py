"""The PyRobot driver against stand-ins with PyRobot's published signatures, in a process of its own."""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from taskschema_robot.clock import RealClock
from taskschema_robot.drivers.pyrobot.arm import CHILD, PyrobotArm, PyrobotProcess
from taskschema_robot.errors import EffectTimeoutError, NotConnectedError, NotReadyError, SetpointError
from taskschema_robot.sawyer_interface import COLLISION_STATE, LONGEST_SILENCE

MOUNT = 0.0141


def process(**changes: str) -> PyrobotProcess:
    environment = dict(os.environ) | {
        "PYTHONPATH": str(Path(__file__).parent / "fake_pyrobot"),
        "TASKSCHEMA_SIGNATURES": str(CHILD.with_name("signatures.json")),
    }
    return PyrobotProcess(sys.executable, environment | changes, MOUNT)


@pytest.fixture
def arm():
    driver = PyrobotArm("left", process(), RealClock())
    driver.connect()
    yield driver
    driver.close()


def wait_until(condition, seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_every_call_has_its_published_signature_and_an_effect(arm):
    with pytest.raises(NotReadyError, match="not enabled"):
        wait_until(lambda: sent(arm, arm.state().positions))
    arm.set_speed_ratio(0.2)
    arm.enable()
    goal = arm.state().positions + 0.02
    wait_until(lambda: sent(arm, goal))
    wait_until(lambda: np.allclose(arm.state().positions, goal))
    with pytest.raises(NotReadyError, match="calibrate"):
        arm.set_gripper(0.03)
    arm.calibrate_gripper()
    arm.set_gripper(MOUNT + 0.02)
    wait_until(lambda: arm.gripper_acknowledged)
    wait_until(lambda: arm.state().gripper.opening == pytest.approx(MOUNT + 0.02))
    assert arm.state().wrench[2] == -9.0
    assert {source.name for source in arm.state().sources} == set(LONGEST_SILENCE)
    wait_until(lambda: all(arm.state().time - source.time < 0.5 for source in arm.state().sources))
    arm.stop()
    wait_until(lambda: arm.state().stopped)
    with pytest.raises(NotReadyError, match="told to stop"):
        arm.command(goal)
    with pytest.raises(EffectTimeoutError, match="it is stopped"):
        arm.enable()
    arm.reset()
    arm.enable()
    with pytest.raises(SetpointError):
        wait_until(lambda: sent(arm, goal + 1.0))
    arm.disable()
    assert not arm.state().enabled


def sent(arm, positions) -> bool:
    """Send a set-point, unless this busy machine has kept the states waiting."""
    from taskschema_robot.errors import StaleStateError

    try:
        arm.command(positions)
    except StaleStateError:
        return False
    return True


def test_a_stop_waits_for_no_set_point_and_only_the_newest_is_made():
    arm = PyrobotArm("left", process(TASKSCHEMA_SLOW_SETPOINT="0.5"), RealClock())
    arm.connect()
    arm.enable()
    start = arm.state().positions
    for step in range(1, 21):
        wait_until(lambda step=step: sent(arm, start + 0.001 * step))
    wait_until(lambda: np.allclose(arm.state().positions, start + 0.02), 4.0)
    for _ in range(20):
        wait_until(lambda: sent(arm, start))
    arm.stop()
    wait_until(lambda: arm.state().stopped, 2.0)
    arm.close()


def flood(arm) -> None:
    for _ in range(100_000):
        arm.set_speed_ratio(0.1)


def test_a_process_that_takes_nothing_is_ended_and_waited_for_by_nobody(arm):
    os.kill(arm._process.pid, signal.SIGSTOP)
    begin = time.monotonic()
    with pytest.raises(NotConnectedError, match="does not take commands"):
        flood(arm)
    arm.stop()
    assert time.monotonic() - begin < 5.0
    wait_until(lambda: not arm.connected)


def test_a_process_that_dies_is_noticed(arm):
    arm._process.kill()
    wait_until(lambda: not arm.connected)
    with pytest.raises(NotConnectedError):
        wait_until(lambda: arm.set_speed_ratio(0.1))
    arm.stop()


def test_a_silent_collision_detection_is_named(monkeypatch):
    monkeypatch.setattr("taskschema_robot.drivers.pyrobot.arm.EFFECT_SECONDS", 0.3)
    arm = PyrobotArm("left", process(TASKSCHEMA_SILENT_TOPIC=COLLISION_STATE), RealClock())
    with pytest.raises(NotConnectedError, match=f"nothing comes from {COLLISION_STATE}:"):
        arm.connect()


def test_without_pyrobot_the_reason_is_named():
    bare = process(PYTHONPATH="")
    with pytest.raises(NotConnectedError, match="PyRobot does not come up"):
        PyrobotArm("left", bare, RealClock()).connect()
    missing = PyrobotProcess("/no/such/python", bare.environment, MOUNT)
    with pytest.raises(NotConnectedError, match="cannot be started"):
        PyrobotArm("left", missing, RealClock()).connect()
