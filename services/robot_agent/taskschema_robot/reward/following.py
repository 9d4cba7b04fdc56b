"""Follows an object while the arms move: which way a hinge turns has to be seen."""

import contextlib
import threading
from collections.abc import Callable

from taskschema_robot.errors import CameraError
from taskschema_robot.safety.fault import Fault

FOLLOW_SECONDS = 0.2
"""Between two looks [s]: less than half of `UNSEEN_SECONDS`."""


class FollowingMonitor:
    """Looks once in a while during motions, and finds nothing wrong; see `Monitor`.

    For lock-step, where it may take its time.

    Args:
        follow: looks.

    """

    guards_recovery = False

    def __init__(self, follow: Callable[[], None]) -> None:
        self._follow = follow
        self._due = -float("inf")

    def fault(self, now: float) -> Fault | None:
        """Look if it is time; see `Monitor`."""
        if now >= self._due:
            self._due = now + FOLLOW_SECONDS
            with contextlib.suppress(CameraError):  # the camera's own monitor says so
                self._follow()
        return None


class FollowingThread:
    """Looks once in a while, beside the set-points of a motion. A context manager.

    Args:
        follow: looks.

    """

    def __init__(self, follow: Callable[[], None]) -> None:
        self._follow = follow
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="following", daemon=True)

    def __enter__(self) -> "FollowingThread":
        self._thread.start()
        return self

    def __exit__(self, *unused: object) -> None:
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ending.wait(FOLLOW_SECONDS):
            with contextlib.suppress(CameraError):  # the camera's own monitor says so
                self._follow()
