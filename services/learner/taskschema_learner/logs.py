"""Structured logs: one JSON object a line in the run's folder, warnings in the terminal."""

import logging
import logging.handlers
from datetime import UTC, datetime
from pathlib import Path

import msgspec
from rich.console import Console
from rich.logging import RichHandler

LOGGER = "taskschema"
"""Parent of the loggers of all parts: `taskschema.learner`, `taskschema.worker`, and so on."""
HELD_RECORDS = 1_000
"""Records kept until the run's folder is there."""


class _JsonLines(logging.Formatter):
    """Says when, which part, how serious, what."""

    def format(self, record: logging.LogRecord) -> str:
        facts = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "part": record.name.removeprefix(f"{LOGGER}."),
            "level": record.levelname.lower(),
            "message": record.getMessage(),
        }
        if record.exc_info:
            facts["traceback"] = self.formatException(record.exc_info)
        return msgspec.json.encode(facts).decode()


class RunLog:
    """Sends what all parts log to the terminal (warnings) and to the run's folder (everything)."""

    def __init__(self, console: Console) -> None:
        terminal = RichHandler(console=console, show_path=False, show_time=False, level=logging.WARNING)
        # Records from before the folder is there wait here.
        self._held = logging.handlers.MemoryHandler(HELD_RECORDS, flushLevel=logging.CRITICAL + 1)
        self._logger = logging.getLogger(LOGGER)
        self._logger.setLevel(logging.INFO)
        self._logger.handlers = [terminal, self._held]
        self._logger.propagate = False

    def write_to(self, folder: Path) -> None:
        """Write to `log.jsonl` in the folder from now on, and what was logged before."""
        file = logging.FileHandler(folder / "log.jsonl", encoding="utf-8")
        file.setFormatter(_JsonLines())
        self._held.setTarget(file)
        self._held.flush()
        self._logger.removeHandler(self._held)
        self._logger.addHandler(file)
