"""Where a websocket server is: at a port, or at a file that only who may write to it can connect to."""

from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from websockets.asyncio.client import connect, unix_connect
from websockets.asyncio.server import Server, ServerConnection, serve, unix_serve

Place = int | Path
"""A port of the loopback interface, 0 for a free one; or a file, made anew."""
Handler = Callable[[ServerConnection], Awaitable[None]]

FILE = "unix:"
"""How the address of a file begins."""
LOOPBACK = "127.0.0.1"


def connecting(url: str, path: str = "", **options: Any) -> connect:  # noqa: ANN401 - as `connect` takes them
    """Return what connects to a server, past any proxy.

    Args:
        url: such as `ws://192.168.1.10:9090` or `unix:/twin/left`.
        path: that the server is asked for.
        options: of `connect`.

    """
    if url.startswith(FILE):
        return unix_connect(url.removeprefix(FILE), f"ws://localhost{path}", proxy=None, **options)
    return connect(url.rstrip("/") + path, proxy=None, **options)


async def listen(place: Place, handler: Handler, **options: Any) -> tuple[Server, str]:  # noqa: ANN401
    """Listen somewhere on this machine, and return the server and its address.

    Args:
        place: to listen at.
        handler: of each connection.
        options: of `serve`.

    Raises:
        OSError: if the place is in use, or cannot be written to.

    """
    if isinstance(place, Path):
        server = await unix_serve(handler, str(place), **options)
        place.chmod(0o600)
        return server, f"{FILE}{place}"
    server = await serve(handler, LOOPBACK, place, **options)
    return server, f"ws://{LOOPBACK}:{next(iter(server.sockets)).getsockname()[1]}"
