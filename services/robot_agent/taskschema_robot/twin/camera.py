"""The twin's overhead camera, as the agent sees it."""

import time

from taskschema_robot.camera.camera import Frame
from taskschema_robot.camera.fetched_frame import FetchedFrame
from taskschema_robot.camera.reading_thread import ReadingThread
from taskschema_robot.clock import Clock
from taskschema_robot.errors import CameraError, TwinError
from taskschema_robot.twin.client import TwinClient
from taskschema_robot.twin.lock_step import LockStepClock

PERIOD = 0.2
"""Between two pictures in real time [s]: rendering in software shares the machine with the simulation."""


class TwinCamera:
    """A twin's camera in real time: see `Camera`.

    Args:
        url: of the twin's control server; the camera has a connection of its own.
        clock: that frames are stamped with: a twin that cannot keep up is behind the machine's time.

    """

    def __init__(self, url: str, clock: Clock) -> None:
        self._url = url
        self._clock = clock
        self._newest: Frame | None = None
        self._client: TwinClient | None = TwinClient(url)
        self._reader = ReadingThread(self._read, self._reopen, url)

    def _reopen(self) -> None:
        """Connect to the twin again: it may have been started again; in the reading thread."""
        try:
            self._disconnect()
            self._client = TwinClient(self._url)
        except TwinError as error:
            raise CameraError(str(error)) from None

    def _disconnect(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def _read(self) -> Frame:
        start = time.monotonic()
        assert self._client is not None
        now = self._clock.now()
        try:
            frame = self._client.take_picture()
        except TwinError as error:
            raise CameraError(str(error)) from None
        if self._newest is None or frame.number != self._newest.number:  # a frozen one stays as old as it is
            self._newest = FetchedFrame(now, frame.number, frame.digest, lambda: frame.image)
        time.sleep(max(start + PERIOD - time.monotonic(), 0.0))
        return self._newest

    def latest(self) -> Frame:
        """Return the newest picture."""
        return self._reader.latest()

    def close(self) -> None:
        """Stop taking pictures."""
        self._reader.close()
        self._disconnect()


class LockStepCamera:
    """A twin's camera in lock-step: see `Camera`. Only the pictures that are looked at are rendered.

    A frame's image is to be looked at before the clock moves on.

    Args:
        client: of the twin.
        clock: of the same twin.

    """

    def __init__(self, client: TwinClient, clock: LockStepClock) -> None:
        self._client = client
        self._clock = clock

    def latest(self) -> Frame:
        """Return the newest picture."""
        moment, number, digest = self._clock.newest_picture
        return FetchedFrame(moment, number, digest, lambda: self._client.take_picture().image)

    def close(self) -> None:
        """Do nothing: the client is its owner's."""
