"""Drivers by name: each is made, PyRobot's reaches its stand-in, and an unknown one is named."""

import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from taskschema.errors import UnknownNameError
from taskschema_robot.cli.arms import DRIVERS, Robots, robot_hardware
from taskschema_robot.drivers.driver import ArmDriver
from taskschema_robot.drivers.pyrobot.arm import CHILD
from taskschema_robot.errors import NotConnectedError

ADDRESSES = {
    "rosbridge": ("ws://127.0.0.1:9", "ws://127.0.0.1:9"),
    "pyrobot": ("http://left:11311", "http://right:11311"),
}


@pytest.mark.parametrize("name", DRIVERS)
def test_every_driver_is_made_for_both_arms_and_has_all_methods(name):
    with ExitStack() as stack:
        hardware = robot_hardware(stack, Robots(ADDRESSES[name], name, "/no/such/python"))
        assert [driver.name for driver in hardware.drivers] == ["left", "right"]
        for driver in hardware.drivers:
            wanted = [method for method in vars(ArmDriver) if not method.startswith("_")]
            assert all(hasattr(type(driver), method) for method in wanted)
            assert not driver.connected
            with pytest.raises(NotConnectedError):
                driver.connect()


def test_pyrobot_gets_each_arms_own_ros_master(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent / "fake_pyrobot"))
    monkeypatch.setenv("TASKSCHEMA_SIGNATURES", str(CHILD.with_name("signatures.json")))
    with ExitStack() as stack:
        robots = Robots(ADDRESSES["pyrobot"], "pyrobot", sys.executable)
        for driver, address in zip(robot_hardware(stack, robots).drivers, robots.addresses, strict=True):
            driver.connect()
            assert driver.state().positions.shape == (7,)
            environment = Path(f"/proc/{driver._process.pid}/environ").read_bytes().split(b"\0")
            assert f"ROS_MASTER_URI={address}".encode() in environment


def test_an_unknown_driver_is_named_with_those_there_are():
    with ExitStack() as stack, pytest.raises(UnknownNameError, match="pyrobot, rosbridge"):
        robot_hardware(stack, Robots(ADDRESSES["rosbridge"], "pyrobt"))
