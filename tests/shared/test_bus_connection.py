"""Connecting: every failure is one line that says what to do and never shows a password."""

import contextlib
import socket
import threading
from urllib.parse import urlsplit

import pytest

from taskschema.bus.connection import bus_errors, connect
from taskschema.bus.records import RunRecords
from taskschema.errors import BusError
from taskschema_learner.embedded_redis import EmbeddedRedis


def failure(url: str) -> str:
    with pytest.raises(BusError) as caught:
        connect(url)
    message = str(caught.value)
    assert "\n" not in message
    assert "secret" not in message
    return message


def test_nobody_there() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        message = failure(f"redis://user:secret@127.0.0.1:{port}")
    assert str(port) in message
    assert "check that it runs" in message


@pytest.mark.parametrize(
    "url", ["http://user:secret@host", "localhost:6379", "", "redis://:secret@host:port"]
)
def test_no_redis_url(url: str) -> None:
    assert "no Redis URL" in failure(url)


def test_wrong_password(shared_redis: EmbeddedRedis) -> None:
    port = urlsplit(shared_redis.url).port
    assert "check user and password" in failure(f"redis://:secret@127.0.0.1:{port}")
    assert "check user and password" in failure(f"redis://127.0.0.1:{port}")


def old_server(version: str) -> socket.socket:
    """A server that answers INFO with a version."""
    server = socket.create_server(("127.0.0.1", 0))
    info = f"# Server\r\nredis_version:{version}\r\n".encode()
    answers = {b"INFO": b"$%d\r\n%s\r\n" % (len(info), info), b"PING": b"+PONG\r\n"}

    def serve() -> None:
        with contextlib.suppress(OSError):  # the test is over
            while True:
                connection, _ = server.accept()
                while sent := connection.recv(65_536):
                    for command in sent.split(b"*")[1:]:
                        connection.sendall(answers.get(command.split(b"\r\n")[2], b"+OK\r\n"))

    threading.Thread(target=serve, daemon=True).start()
    return server


@pytest.mark.parametrize("version", ["5.0.7", "6.0.16", "no number"])
def test_too_old(version: str) -> None:
    with old_server(version) as server:
        message = failure(f"redis://127.0.0.1:{server.getsockname()[1]}")
    assert message.endswith(f"is version {version}: 6.2 or newer is needed.")


def test_silent_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskschema.bus.connection.ANSWER_SECONDS", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:
        assert "does not answer" in failure(f"redis://127.0.0.1:{server.getsockname()[1]}")


def test_refused_command_is_one_line(shared_redis: EmbeddedRedis) -> None:
    client = connect(shared_redis.url)
    client.set("a-string", "x")
    with pytest.raises(BusError, match="refuses a command: WRONGTYPE"), bus_errors():
        client.lpush("a-string", "y")


def test_server_that_goes_away(tmp_path) -> None:
    with EmbeddedRedis(tmp_path) as server:
        records = RunRecords(connect(server.url, patience=0.5))
        records.ping()
    with pytest.raises(BusError, match="check that it runs"):
        records.ping()
