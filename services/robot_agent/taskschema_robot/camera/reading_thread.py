"""Reads a source of frames in a thread, so that the newest one is always at hand."""

import logging
import threading
from collections.abc import Callable

from taskschema_robot.camera.camera import Frame
from taskschema_robot.errors import CameraError

log = logging.getLogger("taskschema.robot")

FIRST_FRAME_SECONDS = 15.0
"""How long a camera may take to deliver its first picture."""
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 5.0
"""Before a source that failed is opened again [s]; doubled each time."""


class ReadingThread:
    """Keeps the newest frame of a source that blocks until its next one.

    Drivers buffer frames: a reader that comes seldom gets old ones. This one reads all the time. While the
    source has ended or fails, the newest frame stays what it is, and its age says so; the source is opened
    again and again, for a cable may be put back.

    Args:
        read: returns the next frame; raises `CameraError` when there are no more.
        reopen: opens the source again; raises `CameraError` if it is not there.
        name: of the source, for messages.

    """

    def __init__(self, read: Callable[[], Frame], reopen: Callable[[], None], name: str) -> None:
        self._read = read
        self._reopen = reopen
        self._name = name
        self._newest: Frame | None = None
        self._failure: CameraError | None = None
        self._first = threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"camera {name}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        pause = 0.0
        while not self._ending.wait(pause):
            try:
                if pause > 0.0:
                    self._reopen()
                self._take()
                if pause > 0.0:
                    log.info("Camera %s is back", self._name)
                pause = 0.0
            except CameraError as error:
                if pause == 0.0:
                    log.warning("%s It is opened again until it is back.", error)
                self._failure = error
                pause = min(max(2.0 * pause, FIRST_PAUSE), LONGEST_PAUSE)
            self._first.set()

    def _take(self) -> None:
        frame = self._read()
        _ = frame.digest  # takes its time: here, not between the set-points of a motion
        self._newest = frame

    def latest(self) -> Frame:
        """Return the newest frame; the first one is waited for.

        Raises:
            CameraError: if there has been none.
        """
        if self._newest is None:
            self._first.wait(FIRST_FRAME_SECONDS)
        newest = self._newest
        if newest is None:
            raise self._failure or CameraError(f"Camera {self._name} delivers no picture: check its cable.")
        return newest

    def close(self) -> None:
        """Stop reading."""
        self._ending.set()
        self._thread.join(FIRST_FRAME_SECONDS)
