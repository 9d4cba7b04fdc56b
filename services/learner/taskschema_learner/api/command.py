"""The API's own command: it serves a Redis or a run's folder, without a learner."""

import argparse
import ctypes
import os
import signal
import socket
import sys
from pathlib import Path
from types import FrameType

from taskschema.bus.url import REDIS_VARIABLE
from taskschema.errors import ConfigError, TaskschemaError
from taskschema.logs import FORMAT_VARIABLE, log_format, log_to_stderr
from taskschema_learner.api.access import Access
from taskschema_learner.api.address import DEFAULT_HOST, DEFAULT_PORT, Address
from taskschema_learner.api.server import serve
from taskschema_learner.api.source import RunSource
from taskschema_learner.api.tokens import TOKEN_VARIABLE, Tokens, new_token
from taskschema_learner.api.transport import Tls

_PR_SET_PDEATHSIG = 1


def main(arguments: list[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; return the exit status."""
    options = _parser().parse_args(arguments)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)  # the server sends itself the signal again once it has shut down
    try:
        log_to_stderr(log_format(options.log_format))
        if options.parent is not None:
            _die_with(options.parent)
        tls = Tls.of(options.tls_cert, options.tls_key)
        source = _source(options.folder)
        address = Address(options.host, options.port)
        listener = address.listen() if options.fd is None else socket.socket(fileno=options.fd)
        address = address.bound_to(listener)
        given = os.environ.get(TOKEN_VARIABLE)
        token = new_token() if given is None else given
        access = Access(address, Tokens.of(token))
        lines = _announcement(address, tls, token if given is None else None)

        def announce() -> None:
            if options.parent is None:
                print("\n".join(lines), flush=True)

        serve(source, access, listener, options.run, tls, announce)
    except TaskschemaError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _announcement(address: Address, tls: Tls | None, new_token: str | None) -> list[str]:
    url = address.url(tls=tls is not None)
    lines = [f"API: {url} (documentation: {url}/docs)"]
    if new_token is not None:
        lines.append(f"Token for changes: {new_token}")
    if tls is None and not address.is_loopback:
        lines.append("Tokens travel in clear text: put TLS before it, or give a certificate.")
    return lines


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m taskschema_learner.api",
        description=f"Serve runs over HTTP: those in the Redis named by {REDIS_VARIABLE}, or one folder's.",
    )
    parser.add_argument("--folder", type=Path, help="serve this run's folder instead of a Redis")
    parser.add_argument("--run", help="the run that is meant where a request names none")
    parser.add_argument("--host", default=DEFAULT_HOST, help="address to listen on (%(default)s)")
    parser.add_argument("--port", type=int, default=DEFAULT_PORT, help="port; 0: any free one (%(default)s)")
    parser.add_argument(
        "--log-format",
        default=os.environ.get(FORMAT_VARIABLE, "text"),
        metavar="text|json",
        help="text: for people; json: a line of JSON for every event (%(default)s)",
    )
    parser.add_argument("--tls-cert", type=Path, metavar="FILE", help="TLS: the certificate, as PEM")
    parser.add_argument(
        "--tls-key", type=Path, metavar="FILE", help="TLS: its key without a password, as PEM"
    )
    parser.add_argument("--fd", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--parent", type=int, help=argparse.SUPPRESS)
    return parser


def _source(folder: Path | None) -> RunSource:
    if folder is not None:
        from taskschema_learner.api.folder_source import FolderSource

        return FolderSource(folder)
    from taskschema_learner.api.redis_source import RedisSource

    url = os.environ.get(REDIS_VARIABLE)
    if not url:
        raise ConfigError(f"Set {REDIS_VARIABLE} to redis://HOST:PORT/0, or serve a folder with --folder.")
    return RedisSource.connect(url)


def _leave(number: int, frame: FrameType | None) -> None:
    raise SystemExit(0)


def _die_with(parent: int) -> None:
    """Have the kernel stop this process when its parent dies, and stop now if it has died already."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        raise SystemExit(0)
