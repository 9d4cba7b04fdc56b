"""What has to be well beside the arms while they move: the camera, Redis and the run."""

import contextlib
import threading
import time
from collections.abc import Callable

from taskschema.bus.records import RunRecords
from taskschema.errors import BusError
from taskschema_robot.camera.camera import Camera
from taskschema_robot.errors import CameraError
from taskschema_robot.safety.fault import Fault, FaultKind

LOOK_SECONDS = 1.0
"""Between two looks at Redis [s]."""
UNWATCHED = 0.5
"""After so long without a look [s], between two motions, a picture is not known to have been the same."""
ENDED = ("finished", "stopped")
"""What a learner says that ended in order."""


class CameraMonitor:
    """The newest frame must not be too old; see `Monitor`."""

    guards_recovery = False

    def __init__(self, camera: Camera, oldest: float) -> None:
        self._camera = camera
        self._oldest = oldest
        self._number = self._digest = -1
        self._since = self._changed = self._looked = -float("inf")

    def fault(self, now: float) -> Fault | None:
        """Return a fault if the camera stands still: a repeated picture does not count as new.

        Nor does one under a new number: a working camera never sees the very same twice.
        """
        try:
            frame = self._camera.latest()
        except CameraError as error:
            return Fault(FaultKind.CAMERA, f"camera: {error}", now)
        if frame.number != self._number:
            self._number, self._since = frame.number, frame.time
        if frame.digest != self._digest or now - self._looked > UNWATCHED:
            self._digest, self._changed = frame.digest, now
        self._looked = now
        age = now - self._since
        if age > self._oldest:
            return Fault(FaultKind.CAMERA, f"the camera's last picture is {age:.1f} s old", now)
        if now - self._changed > self._oldest:
            reason = f"the camera has sent the same picture for {now - self._changed:.1f} s under new numbers"
            return Fault(FaultKind.CAMERA, reason, now)
        return None


class LinkMonitor:
    """Redis must answer, and the learner must live; looks from a thread of its own. A context manager.

    A learner that is killed, stopped or cut off says nothing of it: its signs of life cease
    (`LearnerLife`). One that ended in order is not missed: what it asked for stands.

    Args:
        records: of the run's Redis, with little patience.
        run: name of the run.
        longest: silence that is borne [s].
        monotonic: the machine's own clock: Redis does not live in a twin's time.

    """

    guards_recovery = False

    def __init__(
        self, records: RunRecords, run: str, longest: float, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._records = records
        self._run = run
        self._longest = longest
        self._monotonic = monotonic
        self._last = self._last_beat = monotonic()
        self._beat: str | None = None
        self._ended = ""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="link-monitor", daemon=True)

    def __enter__(self) -> "LinkMonitor":
        self._thread.start()
        return self

    def __exit__(self, *unused: object) -> None:
        self._stop.set()
        self._thread.join(2.0 * LOOK_SECONDS)

    def _watch(self) -> None:
        while not self._stop.is_set():
            with contextlib.suppress(BusError):  # the silence itself is what counts
                self._look()
            self._stop.wait(LOOK_SECONDS)

    def _look(self) -> None:
        status = self._records.status(self._run)
        self._ended = status.message or "failed" if status.state == "failed" else ""
        self._last = self._monotonic()
        # Its clock may differ from ours: that a beat is new is all that is looked at.
        if status.alive_at != self._beat or status.state in ENDED:
            self._beat, self._last_beat = status.alive_at, self._last

    def fault(self, now: float) -> Fault | None:
        """Return a fault if Redis is silent, or the learner is or has failed."""
        silence = self._monotonic() - self._last
        if silence > self._longest:
            return Fault(FaultKind.LINK, f"Redis has been silent for {silence:.0f} s", now)
        if self._ended:
            return Fault(FaultKind.LINK, f"the learner has failed: {self._ended}", now)
        silence = self._monotonic() - self._last_beat
        if silence > self._longest:
            return Fault(FaultKind.LINK, f"the learner has given no sign of life for {silence:.0f} s", now)
        return None
