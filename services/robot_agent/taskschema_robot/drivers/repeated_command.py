"""A command that is sent again until its effect shows."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

REPEAT_SECONDS = 0.1
"""Between two sends of one command [s], as the vendor's SDK does."""


@dataclass
class RepeatedCommand:
    """Sends one message until `done` says that it has had its effect.

    It repeats itself whenever the robot is heard: without news there is nothing to learn from sending again.
    """

    topic: str
    message: dict[str, Any]
    done: Callable[[], bool]
    last_sent: float
    """[s]"""
    finished: bool = field(default=False)

    def due(self, now: float) -> bool:
        """Return whether to send it again now; once done, never."""
        if self.finished or self.done():
            self.finished = True
            return False
        if now - self.last_sent < REPEAT_SECONDS:
            return False
        self.last_sent = now
        return True
