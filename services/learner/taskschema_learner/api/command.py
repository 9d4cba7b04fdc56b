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
from taskschema_learner.api.access import TOKEN_VARIABLE, Access, new_token
from taskschema_learner.api.address import DEFAULT_HOST, DEFAULT_PORT, Address
from taskschema_learner.api.server import serve
from taskschema_learner.api.source import RunSource

_PR_SET_PDEATHSIG = 1


def main(arguments: list[str] | None = None) -> int:
    """Serve until SIGINT or SIGTERM; return the exit status."""
    options = _parser().parse_args(arguments)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)  # the server sends itself the signal again once it has shut down
    try:
        if options.parent is not None:
            _die_with(options.parent)
        source = _source(options.folder)
        address = Address(options.host, options.port)
        listener = address.listen() if options.fd is None else socket.socket(fileno=options.fd)
        address = address.bound_to(listener)
        given = os.environ.get(TOKEN_VARIABLE)
        token = new_token() if given is None else given
        access = Access(address, token)
        if options.parent is None:
            print(f"API: {address.url} (documentation: {address.url}/docs)", flush=True)
            if given is None:
                print(f"Token for changes: {token}", flush=True)
        serve(source, access, listener, options.run)
    except TaskschemaError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m taskschema_learner.api",
        description=f"Serve runs over HTTP: those in the Redis named by {REDIS_VARIABLE}, or one folder's.",
    )
    parser.add_argument("--folder", type=Path, help="serve this run's folder instead of a Redis")
    parser.add_argument("--run", help="the run that is meant where a request names none")
    parser.add_argument("--host", default=DEFAULT_HOST, help="address to listen on (%(default)s)")
    parser.add_argument("--port", type=int, default=DEFAULT_PORT, help="port; 0: any free one (%(default)s)")
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
