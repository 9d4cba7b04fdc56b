"""A learner's signs of life, for whoever must not go on without one: a robot's watchdog."""

import contextlib
import threading

from taskschema.bus.learner_bus import LearnerBus
from taskschema.errors import BusError, StaleTokenError

INTERVAL_SECONDS = 2.0
"""Time between two signs of life [s]."""


class LearnerLife:
    """A thread, so that a long update does not keep it from beating. A context manager.

    What it says is that the process runs and reaches Redis, and that no newer learner has taken over. A
    process that is killed, stopped or cut off falls silent; a loop that never ends does not.

    Args:
        bus: that holds the token.

    """

    def __init__(self, bus: LearnerBus) -> None:
        self._bus = bus
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="learner-life", daemon=True)

    def __enter__(self) -> "LearnerLife":
        self._thread.start()
        return self

    def __exit__(self, *unused: object) -> None:
        self._stop.set()
        self._thread.join(INTERVAL_SECONDS)

    def _run(self) -> None:
        while True:
            # A Redis that is away is noticed where rounds are opened; here the next beat tries again.
            with contextlib.suppress(BusError):
                try:
                    self._bus.beat()
                except StaleTokenError:  # the training loop stops for it
                    return
            if self._stop.wait(INTERVAL_SECONDS):
                return
