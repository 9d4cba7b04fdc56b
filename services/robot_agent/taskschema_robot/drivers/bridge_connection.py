"""A small rosbridge client that never keeps anything to be sent later."""

import asyncio
import itertools
import logging
import socket
import uuid
from collections import deque
from collections.abc import Callable
from typing import Any

import msgspec
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.protocol import State

from taskschema_robot.drivers.input_output import InputOutput
from taskschema_robot.errors import NotConnectedError
from taskschema_robot.websocket_place import connecting

logger = logging.getLogger(__name__)

Json = dict[str, Any]
OnPublish = Callable[[str, Json], None]
"""Takes a topic and a message; runs in the input-output thread and must not wait."""
Wanted = Callable[[], bool]
"""Whether an operation is still to be sent; asked just before, in the input-output thread."""

SEND_SECONDS = 0.25
"""After which a frame that the network does not take ends the connection: it would arrive too late."""
MOTION_SECONDS = 0.03
"""The same for what moves something: nobody waits for it, and no later set-point may wait behind it."""
SEND_BUFFER = 16384
"""[bytes] that the system may hold back: some fifty set-points, so that few can be late."""
OWN_BUFFER = 2048
"""[bytes] that may wait here beside them: what is more has not been taken by the network."""
LARGEST_FRAME = 10_000_000
"""[bytes]"""


class BridgeConnection:
    """One websocket to one rosbridge.

    Motion commands must not be sent late. So nothing is queued here: what the network does not take at once
    is an error, a connection that broke stays broken, and a new one starts with nothing. In lock-step, where
    the world stands still until somebody asks for time, frames wait for just that: see `flush`.

    Args:
        url: such as `ws://192.168.1.10:9090`, or `unix:FILE` for a twin.
        on_publish: gets what subscribed topics bring.
        input_output: where it lives.
        ping_seconds: between pings, whose answers the bridge owes within twice that [s]; None: no pings, for
            a twin in lock-step.

    """

    def __init__(
        self, url: str, on_publish: OnPublish, input_output: InputOutput, ping_seconds: float | None = 0.5
    ) -> None:
        self.url = url
        self.path = f"/{uuid.uuid4().hex}"
        """Of its own: a genuine bridge ignores it, the twin tells its clients apart by it."""
        self._on_publish = on_publish
        self._input_output = input_output
        self._ping_seconds = ping_seconds
        self._socket: ClientConnection | None = None
        self._calls: dict[str, asyncio.Future[Json]] = {}
        self._numbers = itertools.count()
        self._reader: asyncio.Task[None] | None = None
        self._sending: set[asyncio.Task[None]] = set()
        self._unsent: deque[tuple[str, Wanted]] = deque()
        """In lock-step: frames that go before time passes."""
        self._awaited: tuple[int, asyncio.Future[None]] | None = None
        self.frames_sent = 0
        """Frames given to the network so far."""
        self.frames_received = 0
        """Frames taken in so far."""

    def open(self, timeout: float = 5.0) -> None:
        """Connect.

        Raises:
            NotConnectedError: if nobody answers there in time.
        """
        try:
            self._input_output.run(self._open(timeout), timeout + 1.0)
        except (OSError, TimeoutError, InvalidHandshake, InvalidURI) as error:
            raise NotConnectedError(
                f"No rosbridge at {self.url} ({error or type(error).__name__}): check the address, the"
                " network, and that rosbridge runs on the robot."
            ) from None

    async def _open(self, timeout: float) -> None:
        self._socket = await connecting(
            self.url,
            self.path,
            compression=None,
            open_timeout=timeout,
            close_timeout=1.0,
            ping_interval=self._ping_seconds,
            ping_timeout=None if self._ping_seconds is None else 2.0 * self._ping_seconds,
            max_size=LARGEST_FRAME,
            max_queue=None,
            write_limit=OWN_BUFFER,
        )
        raw = self._socket.transport.get_extra_info("socket")
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self._reader = asyncio.create_task(self._read(self._socket))

    @property
    def _lock_step(self) -> bool:
        return self._ping_seconds is None

    @property
    def is_open(self) -> bool:
        """Whether the connection stands and its last ping was answered."""
        return self._socket is not None and self._socket.state is State.OPEN

    def send(self, operation: Json) -> None:
        """Send an operation now.

        Raises:
            NotConnectedError: if the connection is down, or the network does not take it at once.
        """
        text = msgspec.json.encode(operation).decode()
        if self._lock_step and self.is_open:
            self._unsent.append((text, _always))
            return
        try:
            self._input_output.run(self._send(text), SEND_SECONDS)
        except ConnectionClosed as error:
            raise NotConnectedError(
                f"The connection to {self.url} is down ({error}): connect again."
            ) from None
        except TimeoutError:
            self.abort()
            raise NotConnectedError(
                f"The network to {self.url} does not take commands: the connection was ended, so that none"
                " arrives late. Check the cable, then connect again."
            ) from None

    def send_soon(self, operation: Json) -> None:
        """Send an operation without waiting, from any thread; if the connection is down, not at all."""
        self._send_from_anywhere(operation, _always, None)

    def send_motion(self, operation: Json, wanted: Wanted) -> None:
        """Send what moves something without waiting, from any thread, if it is wanted when its turn comes.

        One that the network does not take in time ends the connection, so that none arrives late.
        """
        self._send_from_anywhere(operation, wanted, MOTION_SECONDS)

    def _send_from_anywhere(self, operation: Json, wanted: Wanted, seconds: float | None) -> None:
        if not self.is_open:
            return
        text = msgspec.json.encode(operation).decode()
        if self._lock_step:
            self._unsent.append((text, wanted))
        else:
            self._input_output.loop.call_soon_threadsafe(self._begin, text, wanted, seconds)

    def _begin(self, text: str, wanted: Wanted, seconds: float | None) -> None:
        """Begin to send, in the input-output thread; what is begun first arrives first."""
        if not wanted():
            return
        task = asyncio.get_running_loop().create_task(self._send_within(text, seconds))
        self._sending.add(task)
        task.add_done_callback(self._sending.discard)

    async def _send(self, text: str) -> None:
        if self._socket is None:
            raise NotConnectedError(f"There is no connection to {self.url}: connect first.")
        self.frames_sent += 1
        await self._socket.send(text)

    async def _send_within(self, text: str, seconds: float | None) -> None:
        try:
            async with asyncio.timeout(seconds):
                await self._send(text)
        except ConnectionClosed:
            logger.info("not sent: the connection to %s is down", self.url)
        except TimeoutError:
            logger.warning("the network to %s does not take commands: the connection was ended", self.url)
            self.abort()

    async def flush(self) -> None:
        """Send what has waited for the twin's time to pass; from within the loop, in lock-step."""
        while self._unsent:
            text, wanted = self._unsent.popleft()
            if wanted():
                await self._send_within(text, None)

    def call(self, service: str, arguments: Json, timeout: float = 5.0) -> Json:
        """Call a service and return its answer's values.

        Raises:
            NotConnectedError: if the connection is down, the service fails, or there is no answer in time.
        """
        try:
            answer = self._input_output.run(self._call(service, arguments), timeout)
        except (ConnectionClosed, TimeoutError) as error:
            reason = "no answer in time" if isinstance(error, TimeoutError) else str(error)
            raise NotConnectedError(f"Service {service} at {self.url}: {reason}.") from None
        if not answer.get("result"):
            raise NotConnectedError(f"Service {service} at {self.url} failed: {answer.get('values')}.")
        values: Json = answer["values"]
        return values

    async def _call(self, service: str, arguments: Json) -> Json:
        identifier = str(next(self._numbers))
        answer: asyncio.Future[Json] = asyncio.get_running_loop().create_future()
        self._calls[identifier] = answer
        request = {"op": "call_service", "id": identifier, "service": service, "args": arguments}
        try:
            await self.flush()
            await self._send(msgspec.json.encode(request).decode())
            return await answer
        finally:
            del self._calls[identifier]

    async def received(self, count: int, timeout: float = 5.0) -> None:
        """Wait until `count` frames have been taken in, or the connection breaks; in the input-output thread.

        Raises:
            NotConnectedError: if they do not come in time.
        """
        if self.frames_received >= count or not self.is_open:
            return
        arrived: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._awaited = (count, arrived)
        await asyncio.wait({arrived}, timeout=timeout)
        self._awaited = None
        if self.frames_received < count and self.is_open:
            raise NotConnectedError(f"{self.url} has sent {count} frames; {self.frames_received} arrived.")

    async def _read(self, connection: ClientConnection) -> None:
        try:
            while True:
                self._handle(await connection.recv())
                self.frames_received += 1
                self._tell_waiting()
        except ConnectionClosed:
            return
        finally:
            for answer in self._calls.values():
                answer.cancel()
            self._tell_waiting(always=True)

    def _tell_waiting(self, *, always: bool = False) -> None:
        if self._awaited is None or self._awaited[1].done():
            return
        if always or self.frames_received >= self._awaited[0]:
            self._awaited[1].set_result(None)

    def _handle(self, frame: str | bytes) -> None:
        try:
            message = msgspec.json.decode(frame, type=dict)
            if message["op"] == "publish":
                self._on_publish(message["topic"], message["msg"])
            elif message["op"] == "service_response" and message.get("id") in self._calls:
                answer = self._calls[message["id"]]
                if not answer.done():
                    answer.set_result(message)
        except (msgspec.MsgspecError, AttributeError, LookupError, TypeError, ValueError) as error:
            # One odd frame must not end the stream: what it would have told is then old, and that is watched.
            logger.warning("%s sent a frame that cannot be read: %s", self.url, error)

    def abort(self) -> None:
        """End the connection without ceremony."""
        connection = self._socket
        if connection is not None:
            self._input_output.loop.call_soon_threadsafe(connection.transport.abort)

    def close(self) -> None:
        """End the connection."""
        if self._socket is None:
            return
        try:
            self._input_output.run(self._close(self._socket), 3.0)
        except TimeoutError:
            self.abort()

    async def _close(self, connection: ClientConnection) -> None:
        await self.flush()
        await connection.close()
        if self._reader is not None:
            await asyncio.gather(self._reader, return_exceptions=True)


def _always() -> bool:
    return True
