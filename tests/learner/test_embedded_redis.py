"""The embedded Redis: durable, private, alone on its folder, and gone with its parent."""

import logging
import os
import signal
import stat
import subprocess
import sys
import time
from collections import namedtuple
from pathlib import Path
from urllib.parse import urlsplit

import psutil
import pytest
import redis
from bus_setup import wait_until

from taskschema.bus.connection import connect
from taskschema.errors import RunFolderError
from taskschema_learner import embedded_redis
from taskschema_learner.embedded_redis import EmbeddedRedis


def kill(server: EmbeddedRedis) -> None:
    """Kill the server and wait until the supervisor has started another."""
    before = server.pid
    os.kill(before, signal.SIGKILL)
    wait_until(lambda: server.pid != before)


def test_data_outlives_a_clean_stop(tmp_path: Path) -> None:
    with EmbeddedRedis(tmp_path / 'a folder\'s "name"') as server:
        connect(server.url).set("key", "value")
    with EmbeddedRedis(tmp_path / 'a folder\'s "name"') as server:
        assert connect(server.url).get("key") == b"value"


def test_killed_server_comes_back_with_everything_it_answered(tmp_path: Path) -> None:
    with EmbeddedRedis(tmp_path) as server:
        client = connect(server.url)
        for count in range(1, 4):
            client.incr("counter")
            kill(server)
            assert client.get("counter") == b"%d" % count


def test_server_that_keeps_dying_is_left_dead(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(embedded_redis, "MOST_RESTARTS", 1)
    with EmbeddedRedis(tmp_path) as server, caplog.at_level(logging.ERROR, "taskschema.redis"):
        kill(server)
        os.kill(server.pid, signal.SIGKILL)
        wait_until(lambda: "stays dead" in caplog.text)


def test_truncated_tail_is_cut_off(tmp_path: Path) -> None:
    """A power cut can leave half a command at the end of the file."""
    with EmbeddedRedis(tmp_path) as server:
        client = connect(server.url)
        client.set("first", "1")
        client.set("second", "2")
    path = tmp_path / "appendonly.aof"
    path.write_bytes(path.read_bytes()[:-5])
    with EmbeddedRedis(tmp_path) as server:
        client = connect(server.url)
        assert client.get("first") == b"1"
        assert client.get("second") is None


def test_damaged_file_is_refused_and_kept(tmp_path: Path) -> None:
    with EmbeddedRedis(tmp_path) as server:
        client = connect(server.url)
        for index in range(100):
            client.set(f"key{index}", "value" * 10)
    path = tmp_path / "appendonly.aof"
    data = bytearray(path.read_bytes())
    data[1_000:1_100] = b"\x00" * 100
    path.write_bytes(data)
    with pytest.raises(RunFolderError, match=r"damaged: move appendonly.aof away"), EmbeddedRedis(tmp_path):
        pass
    assert path.read_bytes() == data


def test_second_server_on_a_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embedded_redis, "STOP_SECONDS", 0.2)
    with EmbeddedRedis(tmp_path) as server:
        with pytest.raises(RunFolderError, match="in use by another process"), EmbeddedRedis(tmp_path):
            pass
        assert connect(server.url).ping()


def test_password_is_private(tmp_path: Path) -> None:
    with EmbeddedRedis(tmp_path) as server:
        url = urlsplit(server.url)
        process = psutil.Process(server.pid)
        assert url.password is not None
        assert url.password not in " ".join(process.cmdline())
        assert url.password not in " ".join(process.environ().values())
        assert stat.S_IMODE((tmp_path / "redis.conf").stat().st_mode) == 0o600
        with redis.Redis(port=url.port) as stranger, pytest.raises(redis.AuthenticationError):
            stranger.get("key")
        addresses = {connection.laddr.ip for connection in process.net_connections("inet")}
        assert addresses == {"127.0.0.1"}
        first = url.password
    with EmbeddedRedis(tmp_path) as server:
        assert urlsplit(server.url).password != first


def test_no_room_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(embedded_redis.shutil, "disk_usage", lambda path: usage(2**30, 2**30, 2**20))
    with pytest.raises(RunFolderError, match="No room on the disk.*1 MiB are free"), EmbeddedRedis(tmp_path):
        pass


def test_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="cannot be used"), EmbeddedRedis(tmp_path / "file" / "redis"):
        pass


def test_stop_is_quick_and_complete(tmp_path: Path) -> None:
    with EmbeddedRedis(tmp_path) as server:
        pid = server.pid
        start = time.monotonic()
    assert time.monotonic() - start < embedded_redis.STOP_SECONDS
    assert not psutil.pid_exists(pid)


CHILD = """
import sys, time
from pathlib import Path
from taskschema.bus.connection import connect
from taskschema_learner.embedded_redis import EmbeddedRedis
with EmbeddedRedis(Path(sys.argv[1])) as server:
    connect(server.url).set("key", "value")
    print(server.pid, flush=True)
    time.sleep(600)
"""


def test_server_dies_with_its_parent_and_the_next_one_goes_on(tmp_path: Path) -> None:
    child = subprocess.Popen([sys.executable, "-c", CHILD, str(tmp_path)], stdout=subprocess.PIPE)
    assert child.stdout is not None
    pid = int(child.stdout.readline())
    child.kill()
    child.wait()
    with EmbeddedRedis(tmp_path) as server:  # at once: it waits for the dying one
        assert connect(server.url).get("key") == b"value"
        wait_until(lambda: not psutil.pid_exists(pid))


def test_interrupt_from_the_terminal_is_not_for_the_server(tmp_path: Path) -> None:
    with EmbeddedRedis(tmp_path) as server:
        assert os.getsid(server.pid) != os.getsid(0)
