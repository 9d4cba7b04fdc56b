"""One client of the bridge: the operations of the rosbridge v2 protocol."""

import asyncio
import json
from collections.abc import Callable
from typing import Any

import msgspec

from taskschema_robot.twin.ros.bridge import Bridge
from taskschema_robot.twin.ros.graph import ServiceError
from taskschema_robot.twin.ros.incoming import DeafenedError, FrameBuffer
from taskschema_robot.twin.ros.message import Message, MessageError, fields_of, read_message
from taskschema_robot.twin.ros.serialisation import ros_time, serialise
from taskschema_robot.twin.ros.subscription import Send, Settings, Subscription

Json = dict[str, Any]

MISSING_COMPRESSIONS = ("cbor", "cbor-raw")
"""What the genuine bridge offers and this one does not."""


class DuplicateFragmentError(Exception):
    """A fragment whose number has come before, perhaps on a connection that is long closed."""


class FragmentStore:
    """Unfinished fragments by id: shared by all clients of a bridge, as in the genuine one."""

    def __init__(self) -> None:
        self._parts: dict[Any, dict[int, str]] = {}

    def add(self, message: Json) -> str | None:
        """Keep a fragment; return the joined text once the last one has come.

        Fragments are joined in the order of their arrival: one out of order spoils the text.

        Raises:
            MessageError: if the fragment is not one.
            DuplicateFragmentError: if there already is one of its number.
        """
        identifier, number, total = (message.get(key) for key in ("id", "num", "total"))
        if identifier is None or not isinstance(number, int) or not isinstance(message.get("data"), str):
            raise MessageError("fragment: id, num, total and data are needed")
        parts = self._parts.setdefault(identifier, {})
        if number in parts:
            raise DuplicateFragmentError(f"error while trying to append fragment {number}")
        parts[number] = message["data"]
        if not isinstance(total, int):
            if isinstance(total, float) and len(parts) == total:
                del self._parts[identifier]
                raise MessageError("fragment: total is no integer")
            return None
        if len(parts) < total:
            return None
        del self._parts[identifier]
        return "".join(parts.values())


class BridgeSession:
    """One client's connection; frames come in by `incoming`, and leave by `send`.

    Args:
        number: of the client, for the log.
        bridge: that it is connected to.
        fragments: of all the bridge's clients.
        send: takes the frames for the client.
        congested: says whether they pile up.

    """

    def __init__(
        self,
        number: int,
        bridge: Bridge,
        fragments: FragmentStore,
        send: Send,
        congested: Callable[[], bool] = lambda: False,
    ) -> None:
        self.number = number
        self._congested = congested
        self._bridge = bridge
        self._fragments = fragments
        self._send = send
        self._buffer = FrameBuffer()
        self._deaf = False
        self._fragment_size: int | None = None
        self._subscriptions: dict[str, Subscription] = {}
        self._calls: set[asyncio.Task[None]] = set()
        self._operations: dict[Any, Callable[[Json], None]] = {
            "advertise": self._advertise,
            "unadvertise": self._unadvertise,
            "publish": self._publish,
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "call_service": self._call_service,
            "fragment": self._fragment,
        }

    def incoming(self, text: str) -> None:
        """Handle a frame; whatever is wrong with it shows in the bridge's log and nowhere else."""
        if self._deaf:
            return
        try:
            for found in self._buffer.objects(text):
                self._handle(found)
        except DeafenedError as error:
            self._deaf = True
            self._bridge.log("STDERR", str(error))

    def leave(self) -> None:
        """End the session; service calls under way are executed, their answers are lost."""
        self._bridge.leave(self.number)

    def send_frame(self, frame: str, keep: int = 0) -> None:
        """Send a frame, in fragments if the client ever asked for them."""
        size = self._fragment_size
        if size is None or len(frame) <= size:
            self._send(frame, keep)
            return
        if size < 1:
            self._bridge.log("ERROR", "Exception calling subscribe callback: float division by zero")
            return
        identifier = json.loads(frame).get("id", 0)
        for number, start in enumerate(range(0, len(frame), size)):
            # The genuine bridge sends this quotient as the total, not the number of fragments.
            part = {"op": "fragment", "id": identifier, "data": frame[start : start + size], "num": number}
            self._send(msgspec.json.encode(part | {"total": len(frame) / size}).decode(), 0)

    def _handle(self, found: Any) -> None:  # noqa: ANN401 - any JSON
        if isinstance(found, (bool, int, float)):
            raise DeafenedError(f"a frame that is {found!r} has no keys")
        if not isinstance(found, dict) or "op" not in found:
            identifier = found.get("id") if isinstance(found, dict) else None
            self._error(identifier, "Received a message without an op.")
            return
        operation = found["op"]
        identifier = found.get("id")
        try:
            handler = self._operations[operation]
        except (KeyError, TypeError):
            self._error(identifier, f"Unknown operation: {operation}.")
            return
        if "png" in found and "msg" not in found:
            raise DeafenedError("a message with a png key and no msg")
        try:
            self._take_fragment_size(found)
            handler(found)
        except MessageError as error:
            self._error(identifier, f"{operation}: {error}")

    def _error(self, identifier: object, text: str) -> None:
        mark = "" if identifier is None else f"[id: {identifier}] "
        self._bridge.log("ERROR", f"[Client {self.number}] {mark}{text}")

    def _take_fragment_size(self, message: Json) -> None:
        if "fragment_size" in message:
            self._fragment_size = _field(message, "fragment_size", int)

    def _advertise(self, message: Json) -> None:
        topic, type_name = _field(message, "topic", str), _field(message, "type", str)
        latch = message.get("latch") is True
        self._bridge.advertise(self.number, message.get("id"), topic, type_name, latch=latch)

    def _unadvertise(self, message: Json) -> None:
        self._bridge.unadvertise(self.number, message.get("id"), _field(message, "topic", str))

    def _publish(self, message: Json) -> None:
        topic = _field(message, "topic", str)
        type_name = self._bridge.type_of(topic)
        values = message.get("msg", {})
        content = read_message(type_name, values, ros_time(self._bridge.stamp()))
        self._bridge.publish(self.number, topic, content)

    def _subscribe(self, message: Json) -> None:
        topic = _field(message, "topic", str)
        throttle = _field(message, "throttle_rate", int, 0) / 1000.0
        queue_length = _field(message, "queue_length", int, 0)
        compression = _field(message, "compression", str, "none")
        if compression in MISSING_COMPRESSIONS:
            self._bridge.log("WARN", f"This twin does not offer {compression}: frames are plain.")
        subscription = self._subscriptions.setdefault(topic, Subscription(self.send_frame, self._congested))
        subscription.ask(message.get("id"), Settings(throttle, queue_length, compression == "png"))
        try:
            self._bridge.subscribe(self.number, topic, message.get("type"), subscription)
        except MessageError:
            if len(subscription.ids) == 1:
                del self._subscriptions[topic]
            raise

    def _unsubscribe(self, message: Json) -> None:
        topic = _field(message, "topic", str)
        subscription = self._subscriptions.get(topic)
        if subscription is None:
            return
        if "id" in message:
            subscription.withdraw(message["id"])
        else:
            subscription.ids.clear()
        if not subscription.ids:
            del self._subscriptions[topic]
            self._bridge.unsubscribe(self.number, topic)

    def _fragment(self, message: Json) -> None:
        try:
            text = self._fragments.add(message)
        except DuplicateFragmentError as error:
            self._error(None, str(error))
            return
        if text is not None:
            self.incoming(text)

    def _call_service(self, message: Json) -> None:
        call = asyncio.get_running_loop().create_task(self._answer(_field(message, "service", str), message))
        self._calls.add(call)
        call.add_done_callback(self._calls.discard)

    async def _answer(self, service_name: str, message: Json) -> None:
        answer: Json = {"op": "service_response", "service": service_name}
        identifier = message.get("id", service_name.partition("#")[2] or None)
        try:
            answer |= {"values": await self._call(service_name, message.get("args")), "result": True}
        except (MessageError, ServiceError) as error:
            self._error(identifier, f"call_service {type(error).__name__}: {error}")
            answer |= {"values": str(error), "result": False}
        if identifier is not None:
            answer["id"] = identifier
        self.send_frame(msgspec.json.encode(answer).decode())

    async def _call(self, service_name: str, arguments: Any) -> Message:  # noqa: ANN401 - a client's JSON
        name = "/" + service_name.split("#")[0].lstrip("/")
        service = self._bridge.graph.services.get(name)
        if service is None:
            raise ServiceError(f"Service {name} does not exist")
        if isinstance(arguments, list):
            names = [field.name for field in fields_of(service.request_type)]
            arguments = dict(zip(names, arguments, strict=False))
        values = arguments if isinstance(arguments, dict) else {}
        request = read_message(service.request_type, values, ros_time(self._bridge.stamp()))
        request = serialise(service.request_type, request)
        try:
            response = await service.handler(request)
        except ServiceError as failure:
            text = f"service [{name}] responded with an error: b'{failure}'"
            raise ServiceError(text) from None
        return response


def _field(message: Json, name: str, kind: type, default: Any = None) -> Any:  # noqa: ANN401
    """Return a field of an operation.

    Raises:
        MessageError: if it is missing or of another type.
    """
    if name not in message:
        if default is not None:
            return default
        raise MessageError(f"Expected a {name} field but none was found.")
    value = message[name]
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise MessageError(f"Expected field {name} to be one of ({kind},). Invalid value: {value}")
    return value
