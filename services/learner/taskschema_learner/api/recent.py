"""A cache that is at most some milliseconds old, so that many readers cost Redis no more than one."""

import asyncio
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

from starlette.concurrency import run_in_threadpool

T = TypeVar("T")

MAX_KEYS = 64
"""Runs whose values are kept."""


class Recent(Generic[T]):
    """Values loaded in a thread, by key; belongs to one event loop.

    A value older than `fresh` seconds is loaded again, but up to `usable` seconds readers get the old one
    meanwhile: Redis may be busy writing to its disk, and nobody should wait for that.
    """

    def __init__(self, load: Callable[[str], T], *, fresh: float, usable: float) -> None:
        self._load = load
        self._fresh = fresh
        self._usable = usable
        self._values: OrderedDict[str, tuple[float, T]] = OrderedDict()
        self._loading: dict[str, asyncio.Task[T]] = {}

    def fresh(self, key: str) -> T | None:
        """Return the value of a key if it need not be loaded again yet."""
        held = self._values.get(key)
        return held[1] if held is not None and time.monotonic() - held[0] <= self._fresh else None

    async def get(self, key: str) -> T:
        """Return the value of a key; readers that come while it is loaded share that load.

        Raises:
            Exception: whatever loading raises; failures are not kept.
        """
        fresh = self.fresh(key)
        if fresh is not None:
            return fresh
        held = self._values.get(key)
        task = self._loading.get(key)
        if task is None:
            task = asyncio.create_task(self._refresh(key))
            self._loading[key] = task
            task.add_done_callback(lambda done: self._finish(key, done))
        if held is not None and time.monotonic() - held[0] <= self._usable:
            return held[1]
        # Shielded: a client that hangs up must not cancel the load that others wait for.
        return await asyncio.shield(task)

    async def _refresh(self, key: str) -> T:
        started = time.monotonic()
        value = await run_in_threadpool(self._load, key)
        self._values[key] = (started, value)
        self._values.move_to_end(key)
        while len(self._values) > MAX_KEYS:
            self._values.popitem(last=False)
        return value

    def _finish(self, key: str, task: asyncio.Task[T]) -> None:
        self._loading.pop(key, None)
        if not task.cancelled():
            task.exception()  # retrieved, so that asyncio does not log what the waiting requests answer
