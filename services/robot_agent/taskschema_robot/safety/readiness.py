"""Bringing arms from stopped to ready: the gate's own business."""

from collections.abc import Sequence

from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmDriver

STOP_SECONDS = 1.0
"""How long a stop may take to show [s]."""
LOOK_SECONDS = 0.01
"""Between two looks at the states [s]."""


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
