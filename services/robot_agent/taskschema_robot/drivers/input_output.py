"""Event loops for everything that reads and writes sockets: in a thread of its own, or in its callers'."""

import asyncio
import threading
from collections.abc import Coroutine
from functools import cache
from typing import Any, Protocol, TypeVar

import uvloop

Result = TypeVar("Result")


class InputOutput(Protocol):
    """Runs coroutines for callers in any thread."""

    loop: asyncio.AbstractEventLoop

    def run(self, work: Coroutine[Any, Any, Result], timeout: float) -> Result:
        """Run `work` and return its result.

        Raises:
            TimeoutError: if it takes longer than `timeout` seconds; it is cancelled then.
        """


class InputOutputThread:
    """A loop in a thread of its own, where sockets are read at any time; see `InputOutput`."""

    def __init__(self) -> None:
        self.loop: asyncio.AbstractEventLoop = uvloop.new_event_loop()
        threading.Thread(target=self.loop.run_forever, name="input-output", daemon=True).start()

    def run(self, work: Coroutine[Any, Any, Result], timeout: float) -> Result:
        """Run work in the loop's thread; see `InputOutput`."""
        future = asyncio.run_coroutine_threadsafe(work, self.loop)
        try:
            return future.result(timeout)
        except TimeoutError:
            future.cancel()
            raise


class InputOutputInTurn:
    """A loop that runs in its callers' threads, one at a time; see `InputOutput`.

    In between, nothing is read: that suits a twin in lock-step, where nothing happens in between, and saves
    what it costs to hand work from thread to thread.
    """

    def __init__(self) -> None:
        self.loop: asyncio.AbstractEventLoop = uvloop.new_event_loop()
        self._turn = threading.Lock()

    def run(self, work: Coroutine[Any, Any, Result], timeout: float) -> Result:
        """Run work in this thread; see `InputOutput`."""
        with self._turn:
            task = self.loop.create_task(work)
            end = self.loop.call_later(timeout, task.cancel)
            try:
                return self.loop.run_until_complete(task)
            except asyncio.CancelledError:
                raise TimeoutError from None
            finally:
                end.cancel()

    def close(self) -> None:
        """End the loop: its sockets are closed."""
        with self._turn:
            self.loop.close()


@cache
def input_output() -> InputOutputThread:
    """Return the process' thread; it starts with the first call."""
    return InputOutputThread()
