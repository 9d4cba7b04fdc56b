"""A key that a person holds down while the arms may move."""

import time
from collections.abc import Callable

from taskschema_robot.safety.fault import Fault, FaultKind

HOLD_KEY = "h"
"""The one key that counts: every other has a meaning of its own, or none."""
FIRST_REPEAT = 0.7
"""Within which a held key comes a second time [s]: terminals wait up to two thirds of a second."""
LONGEST_GAP = 0.4
"""Between two repeats after that [s]; terminals send one every 30 to 90 ms, a network may hold some back."""


class HoldToRun:
    """Knows whether the key is held down; see `Monitor`.

    A terminal says only that a key came, not that it went up again: held is what keeps coming.

    Args:
        monotonic: the clock that keys are timed by.

    """

    guards_recovery = True

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._monotonic = monotonic
        self._last = -float("inf")
        self._repeats = False

    def take(self, key: str) -> bool:
        """Note a key; return whether it was the one to hold."""
        if key != HOLD_KEY:
            return False
        now = self._monotonic()
        self._repeats = now - self._last <= FIRST_REPEAT
        self._last = now
        return True

    @property
    def held(self) -> bool:
        """Whether the key is held down: a single press does not tell yet."""
        return self._repeats and self._monotonic() - self._last <= LONGEST_GAP

    def fault(self, now: float) -> Fault | None:
        """Return a fault if the key is not held."""
        return None if self.held else Fault(FaultKind.REQUESTED, "the hold-to-run key is not held", now)
