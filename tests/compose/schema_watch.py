"""Somebody who asks for the schema all the time, whatever happens to the rest."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from tests.compose.stack import RUN, Stack

PERIOD_SECONDS = 0.25


class SchemaWatch:
    """Asks `GET /schema` four times a second while entered.

    Failures while the API itself or its Redis is away on purpose (`excused`) are counted apart.
    """

    def __init__(self, stack: Stack) -> None:
        self.answered = 0
        self.excused_failures = 0
        self.failures: list[str] = []
        self.versions: list[int] = []
        self.slowest = 0.0
        """Longest answer outside excused times [s]."""
        self._stack = stack
        self._excuses = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._ask, daemon=True)

    def __enter__(self) -> "SchemaWatch":
        self._thread.start()
        return self

    def __exit__(self, *unused: object) -> None:
        self._stop.set()
        self._thread.join()

    @contextmanager
    def excused(self) -> Iterator[None]:
        """Forgive failures until the schema is answered again."""
        self._excuses += 1
        yield
        self._stack.wait(lambda: bool(self._stack.get(f"/schema?run={RUN}")), "the schema")
        self._excuses -= 1

    def _ask(self) -> None:
        while not self._stop.wait(PERIOD_SECONDS):
            excused, started = self._excuses, time.monotonic()
            try:
                document = self._stack.get(f"/schema?run={RUN}")
            except OSError as error:
                if excused or self._excuses:
                    self.excused_failures += 1
                else:
                    self.failures.append(str(error))
                continue
            self.answered += 1
            self.versions.append(document["version"])
            if not (excused or self._excuses):
                self.slowest = max(self.slowest, time.monotonic() - started)
