"""Logs: JSON with run, round and slot, and no password, whatever is logged."""

import io
import json
import logging
from collections.abc import Iterator

import pytest

from taskschema import logs
from taskschema.errors import UnknownNameError

URL = "rediss://worker:hunter2@redis.example:6379/0?ssl_ca_certs=ca.pem"


@pytest.fixture
def stream() -> Iterator[io.StringIO]:
    text = io.StringIO()
    writer = logs.handler("json", text)
    logger = logging.getLogger("taskschema.test")
    logger.addHandler(writer)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    yield text
    logger.removeHandler(writer)
    logs.bind(run=None, round=None)


log = logging.getLogger("taskschema.test")


def lines(stream: io.StringIO) -> list[dict[str, object]]:
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def test_a_line_says_which_run_round_and_slot(stream: io.StringIO) -> None:
    logs.bind(run="a-run", round=3)
    log.info("Refused %s", "something", extra={"slot": 7})
    log.warning("Of another", extra={"round": 4, "slots": [1, 2], "facts": {"episodes": 8}})
    logs.bind(run=None, round=None)
    log.info("About nothing")
    first, second, third = lines(stream)
    assert first.pop("time")
    assert first == {
        "part": "test",
        "level": "info",
        "message": "Refused something",
        "run": "a-run",
        "round": 3,
        "slot": 7,
    }
    assert (second["round"], second["slots"], second["episodes"]) == (4, [1, 2], 8)
    assert set(third) == {"time", "part", "level", "message"}


def test_no_password_is_logged(stream: io.StringIO) -> None:
    log.info("Connecting to %s and %s", URL, "http://user:hunter2@other")
    try:
        raise ValueError(f"cannot reach {URL}")
    except ValueError:
        log.exception("Failed")
    assert "hunter2" not in stream.getvalue()
    assert "worker" not in stream.getvalue()
    assert "rediss://***@redis.example:6379" in stream.getvalue()
    record = logging.LogRecord("taskschema", logging.INFO, "", 0, "Connecting to %s", (URL,), None)
    assert "hunter2" not in logs.TextLines().format(record)


def test_a_format_that_is_none() -> None:
    with pytest.raises(UnknownNameError, match="Valid: json, text"):
        logs.log_format("yaml")
