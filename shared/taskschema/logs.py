"""Logs of every process: lines for people, or JSON for programs; passwords in URLs never show."""

import logging
import re
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Literal, TextIO, get_args

import msgspec

from taskschema.errors import UnknownNameError

LOGGER = "taskschema"
"""Parent of the loggers of all parts: `taskschema.learner`, `taskschema.worker`, and so on."""
LogFormat = Literal["text", "json"]
FORMAT_VARIABLE = "TASKSCHEMA_LOG_FORMAT"
"""Environment variable with the format, for processes that nobody gives options."""
FACTS = ("run", "worker", "round", "slot", "slots")
"""What a record is about: given with `extra`, or for all records of a process with `bind`.

Further facts stand in `extra={"facts": {...}}`."""

_PASSWORD = re.compile(r"(\b[a-z][a-z0-9+.-]*://)[^\s/@]*@", re.IGNORECASE)
_bound: dict[str, Any] = {}


def bind(**facts: str | int | None) -> None:
    """Have all records of this process say these facts from now on; None takes one back."""
    _bound.update(facts)


def redacted(text: str) -> str:
    """Return a text without the users and passwords of the URLs in it."""
    return _PASSWORD.sub(r"\1***@", text)


class JsonLines(logging.Formatter):
    """One JSON object a line: when, which part, how serious, what, and about which run, round and slot."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        facts: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "part": record.name.removeprefix(f"{LOGGER}."),
            "level": record.levelname.lower(),
            "message": redacted(record.getMessage()),
            **_facts(record),
        }
        if record.exc_info:
            facts["traceback"] = redacted(self.formatException(record.exc_info))
        return msgspec.json.encode(facts).decode()


class TextLines(logging.Formatter):
    """One line for people."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)s %(name)s: %(message)s")

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        return redacted(super().format(record))


def _facts(record: logging.LogRecord) -> Mapping[str, Any]:
    given = {name: getattr(record, name, _bound.get(name)) for name in FACTS}
    known = {name: value for name, value in given.items() if value is not None}
    return {**known, **getattr(record, "facts", {})}


def log_format(text: str) -> LogFormat:
    """Return the format of this name.

    Raises:
        UnknownNameError: if there is none.
    """
    for name in get_args(LogFormat):
        if name == text:
            return name  # type: ignore[no-any-return]
    raise UnknownNameError("log format", text, get_args(LogFormat))


def handler(kind: LogFormat, stream: TextIO | None = None) -> logging.Handler:
    """Return what writes records to a stream (standard error) in a format."""
    writer = logging.StreamHandler(sys.stderr if stream is None else stream)
    writer.setFormatter(JsonLines() if kind == "json" else TextLines())
    return writer


def log_to_stderr(kind: LogFormat) -> None:
    """Have all parts of this process log to standard error."""
    logging.basicConfig(level=logging.INFO, handlers=[handler(kind)], force=True)
