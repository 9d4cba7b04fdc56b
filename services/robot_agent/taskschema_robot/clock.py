"""The agent's time: the machine's own, or a twin's that runs in lock-step."""

import time
from typing import Protocol


class Clock(Protocol):
    """Where everything in the agent that waits or measures an age takes its time from.

    Code that only uses this runs unchanged in real time and, much faster, in lock-step with a twin, whose
    world stands still until somebody sleeps.
    """

    def now(self) -> float:
        """Return the time [s] since the epoch; it never runs backwards."""

    def sleep_until(self, moment: float) -> None:
        """Return at `moment` [s], or at once if it has passed."""


class RealClock:
    """The machine's clock: monotonic, anchored at the epoch's time when it was made."""

    def __init__(self) -> None:
        self._anchor = time.time() - time.monotonic()

    def now(self) -> float:
        """Return the time; see `Clock`."""
        return self._anchor + time.monotonic()

    def sleep_until(self, moment: float) -> None:
        """Sleep; see `Clock`."""
        remaining = moment - self.now()
        if remaining > 0.0:
            time.sleep(remaining)
