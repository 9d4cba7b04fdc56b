"""The newest refused plan as a picture, for whoever wonders why the arms stayed."""

import logging
import time
from collections.abc import Callable
from pathlib import Path

from taskschema_robot.agent.step_log import StepRecord
from taskschema_robot.safety.picture import draw_motion

log = logging.getLogger("taskschema.robot")

SPARE_SECONDS = 10.0
"""Between two pictures [s]: one takes half a second of a core, and a new policy is refused at every step."""


class RefusalPicture:
    """Draws refused plans into one file, which is replaced.

    Args:
        path: of the picture.
        monotonic: the machine's own clock.

    """

    def __init__(self, path: Path, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._path = path
        self._monotonic = monotonic
        self._drawn = -float("inf")

    def __call__(self, record: StepRecord) -> None:
        """Draw a refused plan, unless the last one was drawn a moment ago; say in the log where it is."""
        if record.refusal is None:
            return
        refusal, title = record.refusal, ", ".join(record.skills)
        if self._monotonic() < self._drawn + SPARE_SECONDS:
            log.info("Refused, no picture so soon after another: %s: %s", title, refusal.reason)
            return
        part = self._path.with_name(f"{self._path.stem}.part{self._path.suffix}")
        draw_motion(part, record.motion, refusal, title)
        part.replace(self._path)
        self._drawn = self._monotonic()
        log.info("Refused, see %s: %s: %s", self._path, title, refusal.reason)
