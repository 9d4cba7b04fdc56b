"""Where a training's logs go: everything into the run's folder as JSON, and what matters to the terminal."""

import logging
import logging.handlers
from pathlib import Path

from rich.console import Console
from rich.logging import RichHandler

from taskschema.logs import LOGGER, JsonLines, LogFormat, handler

HELD_RECORDS = 1_000
"""Records kept until the run's folder is there."""


class RunLog:
    """Sends what all parts log to the run's folder and the terminal: warnings for people, all as JSON."""

    def __init__(self, console: Console, kind: LogFormat = "text") -> None:
        shown = RichHandler(console=console, show_path=False, show_time=False, level=logging.WARNING)
        # Records from before the folder is there wait here.
        self._held = logging.handlers.MemoryHandler(HELD_RECORDS, flushLevel=logging.CRITICAL + 1)
        self._logger = logging.getLogger(LOGGER)
        self._logger.setLevel(logging.INFO)
        self._logger.handlers = [shown if kind == "text" else handler("json"), self._held]
        self._logger.propagate = False

    def write_to(self, folder: Path) -> None:
        """Write to `log.jsonl` in the folder from now on, and what was logged before."""
        file = logging.FileHandler(folder / "log.jsonl", encoding="utf-8")
        file.setFormatter(JsonLines())
        self._held.setTarget(file)
        self._held.flush()
        self._logger.removeHandler(self._held)
        self._logger.addHandler(file)
