"""One event loop in a thread of its own, for everything that reads and writes sockets."""

import asyncio
import threading
from collections.abc import Coroutine
from functools import cache
from typing import TypeVar

Result = TypeVar("Result")


class InputOutputThread:
    """Runs coroutines for callers in other threads."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        threading.Thread(target=self.loop.run_forever, name="input-output", daemon=True).start()

    def run(self, work: Coroutine[None, None, Result], timeout: float) -> Result:
        """Run `work` and return its result.

        Raises:
            TimeoutError: if it takes longer than `timeout` seconds; it is cancelled then.
        """
        future = asyncio.run_coroutine_threadsafe(work, self.loop)
        try:
            return future.result(timeout)
        except TimeoutError:
            future.cancel()
            raise


@cache
def input_output() -> InputOutputThread:
    """Return the process' thread; it starts with the first call."""
    return InputOutputThread()
