"""Where drivers are made: the only place beside the gate that sees one."""

import os
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

from taskschema.errors import UnknownNameError
from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.skills.pairs import ARMS
from taskschema_robot.clock import Clock, RealClock
from taskschema_robot.drivers.driver import ArmDriver
from taskschema_robot.drivers.input_output import InputOutputInTurn
from taskschema_robot.drivers.pyrobot.arm import PyrobotArm, PyrobotProcess
from taskschema_robot.drivers.rosbridge import RosbridgeAddress, RosbridgeArm
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.twin.client import TwinClient
from taskschema_robot.twin.lock_step import LockStepClock
from taskschema_robot.twin.service import TwinService
from taskschema_robot.twin.twin import TwinOptions

JITTER = 0.005
"""By how much a joint state may come early [s]: half of the time between two."""
OWN_TWIN_SECONDS = 30.0
"""How long a twin in this process may take to start or end."""


@dataclass(frozen=True)
class Hardware:
    """What an agent is connected to."""

    drivers: tuple[ArmDriver, ArmDriver]
    """Left arm first; not connected yet."""
    clock: Clock
    twin: TwinClient | None = None
    """The twin, if it is one."""


@dataclass(frozen=True)
class Robots:
    """Where two real Sawyers are, and how they are driven."""

    addresses: tuple[str, str]
    """Left robot first: of its rosbridge, such as `ws://192.168.1.10:9090`, or for PyRobot of its ROS master,
    such as `http://192.168.1.10:11311`."""
    driver: str = "rosbridge"
    """One of `DRIVERS`."""
    pyrobot_python: str = "python3"
    """Interpreter that PyRobot is installed for."""


def distant_twin(stack: ExitStack, url: str) -> TwinClient:
    """Connect to a twin that runs somewhere on this machine."""
    client = TwinClient(url)
    stack.callback(client.close)
    return client


def own_twin(stack: ExitStack, item: RobotObject) -> TwinClient:
    """Start a twin in this process, in lock-step with calibrated grippers, and connect to it.

    It is reached by the same sockets as any other, but nobody has to be woken up when the turn changes: that
    is what training costs most on a busy machine.
    """
    io = InputOutputInTurn()
    stack.callback(io.close)
    service = TwinService(item, TwinOptions(real_time=False, calibrated=True))
    io.run(service.start(), OWN_TWIN_SECONDS)
    stack.callback(lambda: io.run(service.stop(), OWN_TWIN_SECONDS))
    client = TwinClient(service.control.url, io)
    stack.callback(client.close)
    return client


def twin_hardware(stack: ExitStack, client: TwinClient, period: float | None = None) -> Hardware:
    """Return a twin's arms; in lock-step its clock is the agent's.

    Args:
        stack: closes them.
        client: of the twin.
        period: of the set-points [s]: in lock-step, no more joint states are sent; None: all of them.

    """
    description = client.describe()
    real_time = description.real_time
    clock: Clock = RealClock() if real_time else LockStepClock(client)
    throttle = 0 if real_time or period is None else round(1e3 * (period - JITTER))
    addresses = [
        RosbridgeAddress(url, rethink_gripper().closed, 0.5 if real_time else None, throttle)
        for url in description.urls
    ]
    io = clock.input_output if isinstance(clock, LockStepClock) else None
    drivers = [RosbridgeArm(name, address, clock, io) for name, address in zip(ARMS, addresses, strict=True)]
    for driver in drivers:
        stack.callback(driver.close)
        if isinstance(clock, LockStepClock):
            clock.watch(lambda driver=driver: driver.connection)  # type: ignore[misc]
    return Hardware((drivers[0], drivers[1]), clock, client)


def robot_hardware(stack: ExitStack, robots: Robots) -> Hardware:
    """Return drivers of two Sawyers, not connected yet.

    Raises:
        UnknownNameError: if there is no such driver.

    """
    if robots.driver not in DRIVERS:
        raise UnknownNameError("driver", robots.driver, tuple(DRIVERS))
    clock = RealClock()
    drivers = [
        DRIVERS[robots.driver](name, address, robots, clock)
        for name, address in zip(ARMS, robots.addresses, strict=True)
    ]
    for driver in drivers:
        stack.callback(driver.close)
    return Hardware((drivers[0], drivers[1]), clock)


def _rosbridge(name: str, address: str, robots: Robots, clock: Clock) -> ArmDriver:
    return RosbridgeArm(name, RosbridgeAddress(address, rethink_gripper().closed), clock)


def _pyrobot(name: str, address: str, robots: Robots, clock: Clock) -> ArmDriver:
    environment = dict(os.environ) | {"ROS_MASTER_URI": address}
    process = PyrobotProcess(robots.pyrobot_python, environment, rethink_gripper().closed)
    return PyrobotArm(name, process, clock)


DRIVERS: dict[str, Callable[[str, str, Robots, Clock], ArmDriver]] = {
    "rosbridge": _rosbridge,
    "pyrobot": _pyrobot,
}
"""How an arm is made of its name, its address, and what else was said of the robots."""
