"""One client's subscription to one topic."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from taskschema_robot.twin.ros.png import png_frame

Send = Callable[[str, int], None]
"""Takes a frame's text and how many of the kind may wait for a slow reader, 0: all."""


@dataclass
class Settings:
    """What a client asked for under one subscription id."""

    throttle: float
    """Least time between two messages [s]."""
    queue_length: int
    png: bool = False
    """Whether frames come as images."""


@dataclass
class Subscription:
    """All ids of one client on one topic: one stream, with the smallest throttle and queue among them."""

    send: Send
    congested: Callable[[], bool]
    """Whether the client reads so slowly that frames pile up."""
    ids: dict[str | None, Settings] = field(default_factory=dict)
    last_sent: float = float("-inf")
    waiting: deque[str] = field(default_factory=deque)
    """Frames held back by the throttle, oldest first."""

    @property
    def throttle(self) -> float:
        """Least time between two messages [s]."""
        return min((settings.throttle for settings in self.ids.values()), default=0.0)

    @property
    def queue_length(self) -> int:
        """How many frames wait at most; 0: those within the throttle are dropped."""
        return min((settings.queue_length for settings in self.ids.values()), default=0)

    @property
    def blocking(self) -> bool:
        """Whether the publisher has to wait for this client: it reads slowly and asked for no queue."""
        return self.queue_length == 0 and self.congested()

    def offer(self, frame: str, now: float) -> None:
        """Send, hold back or drop a frame."""
        length = self.queue_length
        if self.throttle <= 0.0:
            self._send(frame, now)
        elif length == 0:
            if now - self.last_sent >= self.throttle:
                self._send(frame, now)
        else:
            self.waiting.append(frame)
            while len(self.waiting) > length:
                self.waiting.popleft()
            self.pump(now)

    def pump(self, now: float) -> None:
        """Send what was held back, if its time has come."""
        if self.waiting and now - self.last_sent >= self.throttle:
            self._send(self.waiting.popleft(), now)

    def _send(self, frame: str, now: float) -> None:
        self.last_sent = now
        png = any(settings.png for settings in self.ids.values())
        self.send(png_frame(frame) if png else frame, self.queue_length)
