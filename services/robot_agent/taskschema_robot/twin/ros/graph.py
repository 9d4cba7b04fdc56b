"""The ROS master and the robot's nodes, as the bridge beside them sees them."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from taskschema_robot.twin.ros.made_once import MadeOnce
from taskschema_robot.twin.ros.message import Message

Listener = Callable[[Message], None]
LazyMessage = Callable[[], Message]
"""Makes a message when it is first wanted: most of what a robot publishes is read by nobody."""
Handler = Callable[[Message], Awaitable[Message]]


class ServiceError(Exception):
    """A service that fails; the text reaches the client."""


@dataclass(frozen=True)
class Service:
    """A service of the robot."""

    request_type: str
    response_type: str
    handler: Handler
    """Raises `ServiceError`."""


class Topic:
    """One topic: its type, who listens, and the value that late subscribers get."""

    def __init__(self, type_name: str) -> None:
        self.type_name = type_name
        self.latched: Message | None = None
        """Published last by a latching node or client; late subscribers get it."""
        self.listeners: list[Callable[[LazyMessage], None]] = []
        self.nodes: list[Listener] = []
        """The robot's own subscribers; `listeners` are the bridge's."""

    def deliver(self, message: Message) -> None:
        """Give a message to everybody who listens."""
        for node in self.nodes:
            node(message)
        for listener in self.listeners:
            listener(lambda: message)


class RosGraph:
    """Topics and services of one robot."""

    def __init__(self) -> None:
        self.topics: dict[str, Topic] = {}
        self.services: dict[str, Service] = {}
        self._sequence: dict[str, int] = {}
        self._latching: set[str] = set()

    def topic(self, name: str, type_name: str) -> Topic:
        """Return the topic, which exists from now on."""
        return self.topics.setdefault(name, Topic(type_name))

    def advertise(self, name: str, type_name: str, *, latch: bool = False) -> None:
        """Let a node of the robot publish on a topic."""
        self.topic(name, type_name)
        if latch:
            self._latching.add(name)

    def publish(self, name: str, message: Message) -> None:
        """Publish from a node of the robot; a header's sequence number is counted here."""
        if "header" in message:
            message["header"]["seq"] = self._next_sequence(name)
        topic = self.topics[name]
        if name in self._latching:
            topic.latched = message
        topic.deliver(message)

    def publish_lazily(self, name: str, make: Callable[[int], Message]) -> None:
        """Publish on a topic that does not latch; `make` gets the header's number, if anybody wants it."""
        topic, sequence = self.topics[name], self._next_sequence(name)
        if topic.nodes:
            topic.deliver(make(sequence))
        elif topic.listeners:
            message = MadeOnce(lambda: make(sequence))
            for listener in topic.listeners:
                listener(message)

    def _next_sequence(self, name: str) -> int:
        self._sequence[name] = self._sequence.get(name, 0) + 1
        return self._sequence[name]

    def subscribe(self, name: str, type_name: str, node: Listener) -> None:
        """Let a node of the robot receive what is published on a topic."""
        topic = self.topic(name, type_name)
        topic.nodes.append(node)
        if topic.latched is not None:
            node(topic.latched)

    def serve(self, name: str, service: Service) -> None:
        """Offer a service."""
        self.services[name] = service
