"""A network that does not take what is sent: nobody waits for it, and the other arm is stopped in time."""

import asyncio
import threading
import time

import pytest
from twin_setup import FINGER_MOUNT

from taskschema.safety.limits import SafetyLimits
from taskschema_robot.clock import RealClock
from taskschema_robot.drivers.bridge_connection import BridgeConnection
from taskschema_robot.drivers.input_output import input_output
from taskschema_robot.drivers.rosbridge import RosbridgeAddress, RosbridgeArm
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.sawyer_interface import STOP
from taskschema_robot.websocket_place import listen

STOP_SECONDS = 0.2
"""Issue: both arms are told to stop within 200 ms, by the clock on the wall."""
MUCH = {"op": "publish", "topic": "/padding", "msg": {"data": "x" * 1_000_000}}
"""More than a socket that nobody reads takes."""


class Bridges:
    """Two bridges, each at a file, that note when which frame came; the left one does not read."""

    def __init__(self, folder) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._over = asyncio.Event()
        self.came: list[tuple[float, str]] = []
        listening = [self._run(listen(folder / name, self._serve)) for name in ("left", "right")]
        self._servers, self.urls = zip(*listening, strict=True)

    def _run(self, work):
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(10)

    async def _serve(self, connection) -> None:
        if connection.local_address.endswith("left"):
            connection.transport.pause_reading()
            await self._over.wait()
            connection.transport.abort()
            return
        async for frame in connection:
            self.came.append((time.monotonic(), frame))

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._over.set)
        for server in self._servers:
            self._loop.call_soon_threadsafe(server.close)
            self._run(server.wait_closed())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


@pytest.fixture
def bridges(tmp_path):
    made = Bridges(tmp_path)
    yield made
    made.close()


@pytest.fixture
def arms(bridges):
    """Drivers whose connections stand; of their robots nothing is heard."""
    made = []
    for name, url in zip(("left", "right"), bridges.urls, strict=True):
        arm = RosbridgeArm(name, RosbridgeAddress(url, FINGER_MOUNT), RealClock())
        arm._connection = BridgeConnection(url, arm._on_publish, input_output(), ping_seconds=1e6)
        arm._connection.open()
        made.append(arm)
    yield made
    for arm in made:
        arm._connection.abort()


def wait_until(condition, seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_the_other_arm_is_stopped_in_time(bridges, arms):
    gate = SafetyGate(tuple(arms), arms[0]._clock, SafetyLimits())
    for _ in range(5):
        arms[0].connection.send_soon(MUCH)
    time.sleep(0.1)
    begin = time.monotonic()
    gate.stop("the stop key")
    assert time.monotonic() - begin < STOP_SECONDS
    wait_until(lambda: bridges.came)
    moment, frame = bridges.came[0]
    assert STOP in frame
    assert moment - begin < STOP_SECONDS


def test_a_set_point_is_waited_for_by_nobody_and_never_late(arms):
    blocked = arms[0].connection
    begin = time.monotonic()
    for _ in range(5):
        blocked.send_motion(MUCH, lambda: True)
    assert time.monotonic() - begin < STOP_SECONDS
    wait_until(lambda: not blocked.is_open, 2.0)


def test_a_set_point_on_its_way_is_not_sent_after_a_stop(bridges, arms):
    """The stop comes between the check of a set-point and its turn to be sent."""
    arm = arms[1]
    arm.connection.send_motion({"op": "publish", "topic": "/first"}, arm._may_move)
    wait_until(lambda: len(bridges.came) == 1)
    held = threading.Event()
    input_output().loop.call_soon_threadsafe(held.wait)
    arm.connection.send_motion({"op": "publish", "topic": "/late"}, arm._may_move)
    arm.stop()
    held.set()
    wait_until(lambda: len(bridges.came) == 2)
    time.sleep(0.05)
    assert len(bridges.came) == 2
    assert STOP in bridges.came[1][1]
