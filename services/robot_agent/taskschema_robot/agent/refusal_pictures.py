"""The last refused plans as pictures, for whoever wonders why the arms stayed."""

import logging
import time
from collections.abc import Callable
from pathlib import Path

from taskschema_robot.agent.kept_files import KeptFiles, step_name
from taskschema_robot.agent.step_log import StepRecord
from taskschema_robot.safety.picture import draw_motion

log = logging.getLogger("taskschema.robot")

KEPT = 100
"""Pictures kept; the oldest go."""


class RefusalPictures:
    """Draws refused plans, named by round, slot, attempt and step; see `StepListener`.

    Args:
        folder: of the pictures.
        spare_seconds: between two of them: one takes half a second of a core. 0: all are drawn.
        monotonic: the machine's own clock.

    """

    def __init__(
        self, folder: Path, spare_seconds: float = 0.0, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        self._files = KeptFiles(folder, ".png", KEPT)
        self._spare_seconds = spare_seconds
        self._monotonic = monotonic
        self._drawn = -float("inf")

    def __call__(self, record: StepRecord) -> None:
        """Draw a refused plan, unless one was drawn a moment ago; say in the log where it is."""
        if record.refusal is None:
            return
        refusal, title = record.refusal, ", ".join(record.skills)
        if self._monotonic() < self._drawn + self._spare_seconds:
            log.info("Refused, no picture so soon after another: %s: %s", title, refusal.reason)
            return
        path = self._files.place(step_name(record.key, record.step))
        draw_motion(path, record.motion, refusal, title)
        self._drawn = self._monotonic()
        log.info("Refused, see %s: %s: %s", path, title, refusal.reason)
