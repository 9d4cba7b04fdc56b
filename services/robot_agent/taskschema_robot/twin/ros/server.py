"""The websocket server of one bridge."""

import asyncio
from collections import deque
from http import HTTPStatus

from websockets.asyncio.server import Server, ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from taskschema_robot.twin.ros.bridge import Bridge
from taskschema_robot.twin.ros.session import BridgeSession, FragmentStore
from taskschema_robot.websocket_place import Place, listen

CONGESTED = 40
"""Frames waiting for one client at which it counts as a slow reader, beside what the system holds."""
LARGEST_FRAME = 10_000_000
"""[bytes] as in rosbridge's default settings."""


CLOSE_SECONDS = 0.5
"""How long a client that is being dropped may take to answer a close frame."""


class Outbox:
    """Frames on their way to one client: those of one kind that may not wait push each other out."""

    def __init__(self, connection: ServerConnection) -> None:
        self._connection = connection
        self._frames: deque[tuple[str, str]] = deque()
        self._filled = asyncio.Event()
        self.accepted = 0
        """Frames that have been or will be sent."""

    def congested(self) -> bool:
        """Return whether the client reads too slowly."""
        return len(self._frames) > CONGESTED

    def put(self, frame: str, keep: int) -> None:
        """Queue a frame; at most `keep` of its topic wait behind a slow reader, 0: all."""
        kind = frame[:80]
        if keep:
            waiting = [entry for entry in self._frames if entry[0] == kind]
            for entry in waiting[: max(len(waiting) - keep + 1, 0)]:
                self._frames.remove(entry)
                self.accepted -= 1
        self._frames.append((kind, frame))
        self.accepted += 1
        self._filled.set()

    async def run(self, flowing: asyncio.Event) -> None:
        """Send until the connection closes; nothing while not `flowing`."""
        try:
            while True:
                await self._filled.wait()
                self._filled.clear()
                while self._frames:
                    await flowing.wait()
                    await self._connection.send(self._frames.popleft()[1])
        except ConnectionClosed:
            return


class ClientLink:
    """One open connection, as faults and lock-step see it."""

    def __init__(self, connection: ServerConnection, outbox: Outbox) -> None:
        self.connection = connection
        self.outbox = outbox
        self.handled = 0
        """Frames from the client that the bridge has dealt with."""
        self.progress = asyncio.Event()


class BridgeServer:
    """Serves a bridge on one port of the loopback interface, or at a file.

    Any path is accepted, no compression is agreed on and, unless asked for, no pings are sent: as rosbridge
    does by default. Clients that connect by a path of their own can be found by it.

    Args:
        bridge: what the clients reach.
        place: to listen at.
        ping_interval: of pings of its own [s]; None: none.
        ping_timeout: after which a client that does not answer them is dropped [s].

    """

    def __init__(
        self,
        bridge: Bridge,
        place: Place = 0,
        ping_interval: float | None = None,
        ping_timeout: float = 20.0,
    ) -> None:
        self.bridge = bridge
        self.links: dict[str, ClientLink] = {}
        """Open connections by path."""
        self.url = ""
        """Where it listens, once it does."""
        self._place = place
        self._pings = (ping_interval, ping_timeout)
        self._fragments = FragmentStore()
        self._count = 0
        self._server: Server | None = None
        self._flowing = asyncio.Event()
        self._flowing.set()

    async def start(self) -> None:
        """Listen."""
        interval, timeout = self._pings
        self._server, self.url = await listen(
            self._place,
            self._serve,
            process_request=_plain_http,
            compression=None,
            ping_interval=interval,
            ping_timeout=timeout,
            close_timeout=CLOSE_SECONDS,
            max_size=LARGEST_FRAME,
        )

    async def stop(self) -> None:
        """Close all connections and stop listening."""
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()

    def drop_clients(self) -> None:
        """Tear down all connections without a close frame, as a cut cable or a killed bridge does."""
        for link in list(self.links.values()):
            link.connection.transport.abort()

    def stall(self, *, active: bool) -> None:
        """Let nothing pass in either direction, pongs included, while connections stay open; or end that."""
        if active:
            self._flowing.clear()
        else:
            self._flowing.set()
        for link in self.links.values():
            transport = link.connection.transport
            (transport.pause_reading if active else transport.resume_reading)()

    @property
    def stalled(self) -> bool:
        """Whether nothing passes."""
        return not self._flowing.is_set()

    async def _serve(self, connection: ServerConnection) -> None:
        outbox = Outbox(connection)
        number, self._count = self._count, self._count + 1
        session = BridgeSession(number, self.bridge, self._fragments, outbox.put, outbox.congested)
        path = connection.request.path if connection.request else ""
        link = ClientLink(connection, outbox)
        self.links[path] = link
        writer = asyncio.create_task(outbox.run(self._flowing))
        try:
            await self._read(connection, session, link)
        except ConnectionClosed:
            pass
        finally:
            session.leave()
            writer.cancel()
            if self.links.get(path) is link:
                del self.links[path]

    async def _read(self, connection: ServerConnection, session: BridgeSession, link: ClientLink) -> None:
        while True:
            frame = await connection.recv(decode=False)
            try:
                text = frame.decode()
            except UnicodeDecodeError:
                connection.transport.abort()
                return
            session.incoming(text)
            link.handled += 1
            link.progress.set()


def _plain_http(connection: ServerConnection, request: Request) -> Response | None:
    """Answer a request that is no websocket handshake: the bridge's web server has an empty page there."""
    if "Upgrade" in request.headers:
        return None
    return connection.respond(HTTPStatus.OK, "")
