"""The bridge's own publishers: what clients advertise."""

from dataclasses import dataclass, field

from taskschema_robot.twin.ros.graph import Topic
from taskschema_robot.twin.ros.message import Message, MessageError
from taskschema_robot.twin.ros.serialisation import serialise

UNREGISTER_SECONDS = 10.0
"""For how long a publisher outlives its last client."""


@dataclass
class Publisher:
    """One topic's publisher, shared by all clients that advertised it or published on it."""

    topic: Topic
    latch: bool
    ready_at: float
    """When its connection to the subscriber stands: what is published earlier waits until then [s]."""
    clients: set[tuple[int, str | None]] = field(default_factory=set)
    """Client number and advertisement id."""
    sequence: int = 0
    broken: bool = False
    """By a message that did not serialise: silent from then on, for every client."""
    expires_at: float = float("inf")
    early: list[Message] = field(default_factory=list)

    def publish(self, message: Message, now: float) -> None:
        """Publish a client's message.

        Raises:
            MessageError: if it does not serialise.
        """
        if "header" in message:
            self.sequence += 1
            message["header"]["seq"] = self.sequence
        try:
            received = serialise(self.topic.type_name, message)
        except MessageError:
            self.broken = True
            raise
        if self.broken:
            return
        if self.latch:
            self.topic.latched = received
        if now < self.ready_at:
            self.early.append(received)
        else:
            self._deliver(received)

    def flush(self, now: float) -> None:
        """Deliver what was published before the connection stood; the latched value comes twice then."""
        if self.early and now >= self.ready_at:
            early, self.early = self.early, []
            for message in early + early[-1:] * self.latch:
                self._deliver(message)

    def unregister(self) -> None:
        """End: what it latched is gone."""
        if self.latch:
            self.topic.latched = None

    def _deliver(self, message: Message) -> None:
        self.topic.deliver(message)
