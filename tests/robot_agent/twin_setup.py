"""A twin in a thread of the test's process, and drivers connected to it."""

import asyncio
import threading
from collections.abc import Coroutine
from typing import Any

import numpy as np

from taskschema_robot.clock import Clock
from taskschema_robot.drivers.rosbridge import RosbridgeAddress, RosbridgeArm
from taskschema_robot.objects.catalogue import HEAVY_BAR
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.twin.client import TwinClient
from taskschema_robot.twin.lock_step import LockStepClock
from taskschema_robot.twin.service import TwinService
from taskschema_robot.twin.twin import FINGER_MOUNT, Twin, TwinOptions
from taskschema_robot.websocket_place import Place

EPOCH = 1_800_000_000.0


class RunningTwin:
    """A twin in its own thread and event loop: clients reach it through real sockets."""

    def __init__(
        self, options: TwinOptions, robot_object: RobotObject = HEAVY_BAR, control: Place = 0
    ) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="twin", daemon=True)
        self._thread.start()
        self.service = TwinService(robot_object, options, control)
        self.run(self.service.start())

    def run(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(30)

    @property
    def twin(self) -> Twin:
        return self.service.twin

    @property
    def control_url(self) -> str:
        return self.service.control.url

    def url(self, arm: int) -> str:
        return self.twin.robots[arm].server.url

    def close(self) -> None:
        self.run(self.service.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


def arm_of(running: RunningTwin, arm: int, clock: Clock) -> RosbridgeArm:
    """A driver, not connected yet."""
    pings = 0.5 if running.twin.options.real_time else None
    io = clock.input_output if isinstance(clock, LockStepClock) else None
    address = RosbridgeAddress(running.url(arm), FINGER_MOUNT, pings)
    driver = RosbridgeArm(("left", "right")[arm], address, clock, io)
    if isinstance(clock, LockStepClock):
        clock.watch(lambda: driver.connection)
    return driver


class LockStep:
    """A twin in lock-step with both arms connected, enabled and calibrated."""

    def __init__(self, robot_object: RobotObject = HEAVY_BAR) -> None:
        options = TwinOptions(real_time=False, calibrated=True, epoch=EPOCH)
        self.running = RunningTwin(options, robot_object)
        self.client = TwinClient(self.running.control_url)
        self.clock = LockStepClock(self.client)
        self.arms = tuple(arm_of(self.running, arm, self.clock) for arm in (0, 1))
        for arm in self.arms:
            arm.connect()
            arm.set_speed_ratio(1.0)
            arm.enable()

    def stream(self, arm: RosbridgeArm, goal: np.ndarray, seconds: float) -> None:
        """Send set-points at 100 Hz along a smooth straight path to `goal` [7]."""
        start = arm.state().positions
        for share in np.linspace(0.0, 1.0, round(seconds * 100) + 1)[1:]:
            smooth = share * share * (3.0 - 2.0 * share)
            arm.command(start + smooth * (goal - start))
            self.sleep(0.01)

    def sleep(self, seconds: float) -> None:
        self.clock.sleep_until(self.clock.now() + seconds)

    def close(self) -> None:
        for arm in self.arms:
            arm.close()
        self.client.close()
        self.running.close()
