"""Where drivers are made: the only place beside the gate that sees one."""

from contextlib import ExitStack
from dataclasses import dataclass

from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.skills.pairs import ARMS
from taskschema_robot.clock import Clock, RealClock
from taskschema_robot.drivers.driver import ArmDriver
from taskschema_robot.drivers.rosbridge import RosbridgeAddress, RosbridgeArm
from taskschema_robot.twin.client import TwinClient
from taskschema_robot.twin.lock_step import LockStepClock


@dataclass(frozen=True)
class Hardware:
    """What an agent is connected to."""

    drivers: tuple[ArmDriver, ArmDriver]
    """Left arm first; not connected yet."""
    clock: Clock
    twin: TwinClient | None = None
    """The twin, if it is one."""


def twin_hardware(stack: ExitStack, url: str) -> Hardware:
    """Connect to a twin; in lock-step its clock is the agent's."""
    client = TwinClient(url)
    stack.callback(client.close)
    description = client.describe()
    real_time = description.real_time
    clock: Clock = RealClock() if real_time else LockStepClock(client)
    urls = [f"ws://127.0.0.1:{port}" for port in description.ports]
    drivers = [_arm(stack, name, url, clock, pings=real_time) for name, url in zip(ARMS, urls, strict=True)]
    if isinstance(clock, LockStepClock):
        for driver in drivers:
            clock.watch(lambda driver=driver: driver.connection)  # type: ignore[misc]
    return Hardware((drivers[0], drivers[1]), clock, client)


def robot_hardware(stack: ExitStack, left: str, right: str) -> Hardware:
    """Return drivers of two Sawyers behind their rosbridges."""
    clock = RealClock()
    drivers = [
        _arm(stack, name, url, clock, pings=True) for name, url in zip(ARMS, (left, right), strict=True)
    ]
    return Hardware((drivers[0], drivers[1]), clock)


def _arm(stack: ExitStack, name: str, url: str, clock: Clock, *, pings: bool) -> RosbridgeArm:
    address = RosbridgeAddress(url, rethink_gripper().closed, 0.5 if pings else None)
    driver = RosbridgeArm(name, address, clock)
    stack.callback(driver.close)
    return driver
