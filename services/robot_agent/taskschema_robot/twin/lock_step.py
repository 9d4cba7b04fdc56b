"""The clock of a twin that stands still until somebody sleeps."""

from collections.abc import Callable

from taskschema_robot.drivers.bridge_connection import BridgeConnection
from taskschema_robot.drivers.input_output import InputOutput
from taskschema_robot.twin.client import TwinClient
from taskschema_robot.twin.control_messages import Advanced

LONGEST_STEP = 0.05
"""[s] of simulated time at once: what arrives within one step carries the time at its start."""

Connections = Callable[[], list[BridgeConnection]]


class LockStepClock:
    """A `Clock` whose time passes only in `sleep_until`, and as fast as the twin can simulate.

    Before time passes, the twin has dealt with every frame that was sent; before `sleep_until` returns, every
    frame that the twin has sent has been taken in. So what happens does not depend on the machine's speed.
    One thread may sleep on it.

    Args:
        twin: in lock-step.

    """

    def __init__(self, twin: TwinClient) -> None:
        self._twin = twin
        self._now = twin.describe().time
        self._sources: list[Connections] = []
        self.newest_picture = (self._now, -1, 0)
        """When the camera's newest picture was taken [s], its number, and its digest."""

    @property
    def input_output(self) -> InputOutput:
        """Where the drivers' connections have to live."""
        return self._twin.input_output

    def watch(self, connection: Callable[[], BridgeConnection | None]) -> None:
        """Count the frames of a driver's present connection, whichever that is."""
        self._sources.append(lambda: [found] if (found := connection()) is not None else [])

    def now(self) -> float:
        """Return the twin's time; see `Clock`."""
        return self._now

    def sleep_until(self, moment: float) -> None:
        """Let the twin's time pass until `moment`; see `Clock`."""
        while self._now < moment - 1e-9:
            passed = self._twin.run(self._advance(min(moment, self._now + LONGEST_STEP)))
            self._now = passed.time
            self.newest_picture = (passed.picture_time, passed.picture_number, passed.picture_digest)

    async def _advance(self, until: float) -> Advanced:
        """Send what waits, ask for time, and take in what comes of it."""
        connections = [found for source in self._sources for found in source() if found.is_open]
        for one in connections:
            await one.flush()
        passed = await self._twin.advance(until, {one.path: one.frames_sent for one in connections})
        for one in connections:
            if one.path in passed.sent:
                await one.received(passed.sent[one.path])
        return passed
