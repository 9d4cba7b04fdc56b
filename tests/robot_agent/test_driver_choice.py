"""Drivers by name: each is made, PyRobot's reaches its stand-in, and an unknown one is named."""

import sys
from contextlib import ExitStack
from pathlib import Path
from threading import Event

import pytest
from bus_setup import Run

from taskschema.config import RunConfig
from taskschema.errors import ConfigError, UnknownNameError
from taskschema_robot.cli.arms import DRIVERS, Robots, robot_hardware
from taskschema_robot.cli.serving import Serving, serve
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


@pytest.mark.parametrize(
    ("observation", "said", "reason"),
    [
        ("state", False, "--state-from-markers"),
        ("state", True, "Robots need eyes"),
        ("image", False, "Robots need eyes"),
    ],
)
def test_real_robots_show_no_policy_their_markers_unasked(shared_redis, tmp_path, observation, said, reason):
    config = RunConfig(task="lateral-lifting", observation=observation, slots=3, episodes_per_slot=1)
    with Run(shared_redis.url, config) as run:
        options = Serving(
            run=run.name,
            item="heavy-bar",
            redis=run.url,
            twin=None,
            robots=Robots(ADDRESSES["rosbridge"]),
            camera=None,
            lens=None,
            see_truth=False,
            folder=tmp_path,
            speed_ratio=0.1,
            rate=100,
            stop_port=0,
            hold_to_run=False,
            preview=False,
            unattended=True,
            state_from_markers=said,
        )
        with pytest.raises(ConfigError, match=reason):
            serve(options, Event())
