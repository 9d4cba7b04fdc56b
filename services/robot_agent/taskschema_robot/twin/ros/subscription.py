"""One client's subscription to one topic."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from taskschema_robot.twin.ros.png import png_frame

Frame = Callable[[], str]
"""Makes a frame's text when it is sent."""
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
    waiting: deque[Frame] = field(default_factory=deque)
    """Frames held back by the throttle, oldest first."""

    def __post_init__(self) -> None:
        """Start with nothing asked for."""
        self._settle()

    def ask(self, identifier: str | None, settings: Settings) -> None:
        """Take what a client asks for under an id."""
        self.ids[identifier] = settings
        self._settle()

    def withdraw(self, identifier: str | None) -> None:
        """Forget what was asked for under an id."""
        self.ids.pop(identifier, None)
        self._settle()

    def _settle(self) -> None:
        settings = self.ids.values()
        self.throttle = min((one.throttle for one in settings), default=0.0)
        """Least time between two messages [s]."""
        self.queue_length = min((one.queue_length for one in settings), default=0)
        """How many frames wait at most; 0: those within the throttle are dropped."""

    @property
    def blocking(self) -> bool:
        """Whether the publisher has to wait for this client: it reads slowly and asked for no queue."""
        return self.queue_length == 0 and self.congested()

    def offer(self, frame: Frame, now: float) -> None:
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

    def _send(self, frame: Frame, now: float) -> None:
        self.last_sent = now
        png = any(settings.png for settings in self.ids.values())
        self.send(png_frame(frame()) if png else frame(), self.queue_length)
