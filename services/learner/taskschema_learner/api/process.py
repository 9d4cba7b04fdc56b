"""The API in a process of its own, beside a training."""

import http.client
import os
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from types import TracebackType
from typing import IO, Self

from taskschema.bus.url import REDIS_VARIABLE
from taskschema.errors import ConfigError
from taskschema_learner.api.address import Address
from taskschema_learner.api.rates import Rates
from taskschema_learner.api.tokens import TOKEN_VARIABLE, Tokens, new_token
from taskschema_learner.api.transport import Tls

START_TIMEOUT = 30.0
"""Longest wait for the first answer [s]; usually about one second."""
STOP_TIMEOUT = 4.0
"""Longest wait for running requests when it is told to stop [s]."""


class ApiProcess:
    """Serves the runs of one Redis from a child process while it is entered.

    The child dies with the thread that entered (PR_SET_PDEATHSIG): enter it in the main thread.
    """

    def __init__(
        self,
        redis_url: str,
        run: str | None,
        address: str,
        *,
        token: str | None = None,
        tls: Tls | None = None,
    ) -> None:
        """Describe the process.

        Args:
            redis_url: URL of the Redis; handed over in the environment, because it holds a password.
            run: the run that is meant where a request names none.
            address: HOST:PORT; port 0 takes any free one.
            token: what changes need; None: TASKSCHEMA_API_TOKEN, or a new random one.
            tls: certificate and key; None: no TLS.

        Raises:
            ConfigError: if the address, a token or a limit in the environment cannot be used.
        """
        self._redis_url = redis_url
        self._run = run
        self._address = Address.parse(address)
        given = os.environ.get(TOKEN_VARIABLE) if token is None else token
        self.token = new_token() if given is None else given
        """The bearer token."""
        self.token_is_generated = given is None
        """Whether somebody has to be told the token."""
        self._tls = tls
        Tokens.of(self.token)
        Rates.of()

    @property
    def url(self) -> str:
        """`http://HOST:PORT`, or `https:`; with port 0 the port is known once entered."""
        return self._address.url(tls=self._tls is not None)

    def __enter__(self) -> Self:
        """Start the child and wait until it answers.

        Raises:
            ConfigError: if the port is taken, or the child fails; the message is its own last line.
        """
        with self._address.listen() as listener:
            self._address = self._address.bound_to(listener)
            self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed in __exit__
            self._process = subprocess.Popen(
                self._command(listener),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=self._log,
                env={**os.environ, REDIS_VARIABLE: self._redis_url, TOKEN_VARIABLE: self.token},
                pass_fds=[listener.fileno()],
                start_new_session=True,  # Ctrl-C is for the training, which then stops this process
            )
        try:
            self._wait_until_it_answers()
        except BaseException:
            self._stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the child; running requests may end first."""
        self._stop()

    def _command(self, listener: socket.socket) -> list[str]:
        # The listening socket is handed over open: a taken port shows before anything starts.
        command = [sys.executable, "-m", "taskschema_learner.api"]
        command += ["--host", self._address.host, "--port", str(self._address.port)]
        command += ["--fd", str(listener.fileno()), "--parent", str(os.getpid())]
        if self._tls is not None:
            command += ["--tls-cert", str(self._tls.certificate), "--tls-key", str(self._tls.key)]
        return command if self._run is None else [*command, "--run", self._run]

    def _wait_until_it_answers(self) -> None:
        deadline = time.monotonic() + START_TIMEOUT
        while time.monotonic() < deadline:
            if self._process.poll() is not None:
                raise ConfigError(f"The API did not start: {self._last_line()}")
            with suppress(OSError, http.client.HTTPException):
                if self._answers():
                    return
            time.sleep(0.02)
        raise ConfigError(f"The API at {self.url} does not answer after {START_TIMEOUT:.0f} s.")

    def _answers(self) -> bool:
        # The socket listens before the child reads it: this waits in the queue until it does.
        host, port = self._address.reachable_host, self._address.port
        if self._tls is None:
            connection = http.client.HTTPConnection(host, port, timeout=1)
        else:
            # Our own listening socket: whether its certificate suits its clients is not asked here.
            context = ssl._create_unverified_context()
            connection = http.client.HTTPSConnection(host, port, timeout=1, context=context)
        try:
            connection.request("GET", "/healthz")
            return connection.getresponse().status == 200
        finally:
            connection.close()

    def _last_line(self) -> str:
        self._log.seek(0)
        lines = self._log.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"it ended with status {self._process.returncode}."

    def _stop(self) -> None:
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()
