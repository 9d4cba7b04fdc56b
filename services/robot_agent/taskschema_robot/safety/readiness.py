"""Bringing arms from stopped to ready: the gate's own business."""

from collections.abc import Sequence

from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmDriver
from taskschema_robot.safety.fault import Fault, FaultKind

STOP_SECONDS = 1.0
"""How long a stop may take to show [s]."""
LOOK_SECONDS = 0.01
"""Between two looks at the states [s]."""


def watch_connections(drivers: Sequence[ArmDriver], now: float) -> Fault | None:
    """Return a fault if a connection is down."""
    for driver in drivers:
        if not driver.connected:
            return Fault(FaultKind.CONNECTION, f"{driver.name} arm: its connection is down", now)
    return None


def await_stop(drivers: Sequence[ArmDriver], clock: Clock) -> None:
    """Return once the arms show that they are stopped: a reset before would be followed by the stop."""
    deadline = clock.now() + STOP_SECONDS
    while clock.now() < deadline:
        if all(driver.state().stopped for driver in drivers if driver.connected):
            return
        clock.sleep_until(clock.now() + LOOK_SECONDS)


def make_ready(driver: ArmDriver) -> None:
    """Connect, end a stop, and enable, as far as it is needed.

    Raises:
        RobotError: if the arm is away or cannot be enabled.

    """
    if not driver.connected:
        driver.connect()
    driver.set_speed_ratio(1.0)  # the set-points themselves are as slow as they should be
    driver.reset()
    if not driver.state().enabled:
        driver.enable()
