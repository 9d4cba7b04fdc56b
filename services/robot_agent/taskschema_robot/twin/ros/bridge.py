"""The bridge between one robot's ROS and its clients: rosbridge's shared state."""

import logging
from collections.abc import Callable

import msgspec

from taskschema_robot.twin.ros.graph import LazyMessage, RosGraph, Topic
from taskschema_robot.twin.ros.made_once import MadeOnce
from taskschema_robot.twin.ros.message import Message, MessageError, require_type
from taskschema_robot.twin.ros.publisher import UNREGISTER_SECONDS, Publisher
from taskschema_robot.twin.ros.subscription import Frame, Subscription

logger = logging.getLogger(__name__)

Log = Callable[[str, str], None]
"""Takes level and message."""


class TopicStream:
    """The bridge's subscription to one topic, on behalf of its clients."""

    def __init__(self, name: str, topic: Topic, ready_at: float) -> None:
        self.name = name
        self.topic = topic
        self.ready_at = ready_at
        """When its connection to the publisher stands [s]."""
        self.clients: dict[int, Subscription] = {}

    def frame(self, message: LazyMessage) -> Frame:
        """Return the frame that carries a message: numbers that are not finite as null, bytes as base64."""
        operation = {"op": "publish", "topic": self.name}
        return MadeOnce(lambda: msgspec.json.encode(operation | {"msg": message()}).decode())

    def latched_frame(self, message: Message) -> Frame:
        """Return the frame that carries what the topic keeps for late subscribers."""
        return self.frame(lambda: message)


class Bridge:
    """Topics that clients have advertised or subscribed to, shared between them.

    Args:
        graph: the robot's topics and services.
        now: a clock that never jumps [s].
        link_delay: how long a new connection between bridge and node takes [s]; genuine ones take 0.2 to 0.3.
        stamp: the robot's clock, for headers that give no time [s since the epoch]; None: `now`.
        log: takes what rosbridge writes on its console: that is all the trace that most errors leave.

    """

    def __init__(
        self,
        graph: RosGraph,
        now: Callable[[], float],
        link_delay: float = 0.2,
        *,
        stamp: Callable[[], float] | None = None,
        log: Log | None = None,
    ) -> None:
        self.graph = graph
        self.now = now
        self.stamp = stamp or now
        self.log: Log = log or (lambda level, message: logger.info("%s: %s", level, message))
        self._link_delay = link_delay
        self._publishers: dict[str, Publisher] = {}
        self._streams: dict[str, TopicStream] = {}
        self._pending_latched: list[tuple[float, str, int]] = []

    def advertise(
        self, client: int, advertisement: str | None, name: str, type_name: str, latch: bool
    ) -> None:
        """Let a client publish on a topic.

        Raises:
            MessageError: if the type does not exist or is not the topic's.
        """
        require_type(type_name)
        self._check_type(name, type_name)
        publisher = self._publishers.get(name)
        if publisher is None:
            topic = self.graph.topic(name, type_name)
            publisher = Publisher(topic, latch, self.now() + self._link_delay)
            self._publishers[name] = publisher
        elif latch and not publisher.latch:
            self.log("WARN", f"Topic {name} was registered before, without latch.")
        publisher.clients.add((client, advertisement))
        publisher.expires_at = float("inf")

    def unadvertise(self, client: int, advertisement: str | None, name: str) -> None:
        """Take an advertisement back; the publisher lives on for a while."""
        publisher = self._publishers.get(name)
        if publisher is not None:
            publisher.clients.discard((client, advertisement))
            self._let_expire(publisher)

    def publish(self, client: int, name: str, message: Message) -> None:
        """Publish a client's message on a topic that has a type.

        Raises:
            MessageError: if it does not serialise.
        """
        if name not in self._publishers:
            self.advertise(client, None, name, self.type_of(name), latch=False)
        publisher, now = self._publishers[name], self.now()
        try:
            publisher.publish(message, now)
        except MessageError as error:
            if now >= publisher.ready_at:
                raise
            self.log("WARN", f"Inbound TCP/IP connection failed: {error}")

    def type_of(self, name: str) -> str:
        """Return a topic's type.

        Raises:
            MessageError: if nobody has given it one.
        """
        if name not in self.graph.topics:
            raise MessageError(f"Cannot infer topic type for topic {name} as it is not yet advertised")
        return self.graph.topics[name].type_name

    def subscribe(self, client: int, name: str, type_name: str | None, subscription: Subscription) -> None:
        """Send a client what is published on a topic, the latched value at once.

        Raises:
            MessageError: if the type does not exist, is not the topic's, or is unknown.
        """
        if type_name is None:
            type_name = self.type_of(name)
        require_type(type_name)
        self._check_type(name, type_name)
        stream = self._streams.get(name)
        if stream is None:
            topic = self.graph.topic(name, type_name)
            stream = self._streams[name] = TopicStream(name, topic, self.now() + self._link_delay)
            topic.listeners.append(lambda message: self._offer(stream, message))
        stream.clients[client] = subscription
        self._pending_latched.append((stream.ready_at, name, client))
        self._send_latched()

    def unsubscribe(self, client: int, name: str) -> None:
        """Send a client no more of a topic."""
        if name in self._streams:
            self._streams[name].clients.pop(client, None)

    def leave(self, client: int) -> None:
        """Forget a client that has gone."""
        for stream in self._streams.values():
            stream.clients.pop(client, None)
        for publisher in self._publishers.values():
            publisher.clients = {entry for entry in publisher.clients if entry[0] != client}
            self._let_expire(publisher)

    def tick(self) -> None:
        """Do what is due: throttled messages, connections that stand, publishers that nobody uses."""
        now = self.now()
        for stream in self._streams.values():
            for subscription in stream.clients.values():
                subscription.pump(now)
        for name, publisher in list(self._publishers.items()):
            publisher.flush(now)
            if now >= publisher.expires_at:
                publisher.unregister()
                del self._publishers[name]
        self._send_latched()

    def _check_type(self, name: str, type_name: str) -> None:
        known = self.graph.topics.get(name)
        if known is not None and known.type_name != type_name:
            raise MessageError(
                f"Tried to register topic {name} with type {type_name} but it is already established with"
                f" type {known.type_name}"
            )

    def _let_expire(self, publisher: Publisher) -> None:
        if not publisher.clients and publisher.expires_at == float("inf"):
            publisher.expires_at = self.now() + UNREGISTER_SECONDS

    def _offer(self, stream: TopicStream, message: LazyMessage) -> None:
        if not stream.clients or self.now() < stream.ready_at:
            return
        subscriptions = list(stream.clients.values())
        if any(subscription.blocking for subscription in subscriptions):
            return  # one slow reader without a queue silences the topic for every client
        frame, now = stream.frame(message), self.now()
        for subscription in subscriptions:
            subscription.offer(frame, now)

    def _send_latched(self) -> None:
        now = self.now()
        due = [entry for entry in self._pending_latched if entry[0] <= now]
        self._pending_latched = [entry for entry in self._pending_latched if entry[0] > now]
        for _, name, client in due:
            stream = self._streams[name]
            latched = stream.topic.latched
            if latched is not None and client in stream.clients:
                stream.clients[client].offer(stream.latched_frame(latched), now)
