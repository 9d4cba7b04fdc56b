"""The same work in several processes at once, started together."""

import multiprocessing
import time
from collections.abc import Callable
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Barrier
from queue import Empty
from threading import BrokenBarrierError
from typing import Any

from threadpoolctl import threadpool_limits

LONGEST_SECONDS = 600.0
"""After this long, work is taken for failed [s]."""
Prepare = Callable[[int], Callable[[], Any]]
"""Takes the number of the process, sets everything up, and returns the work to be timed."""


def run_together(prepare: Prepare, processes: int) -> tuple[float, list[Any]]:
    """Return the wall time until the last process is done [s], and what each one's work returned."""
    context = multiprocessing.get_context("spawn")
    ready = context.Barrier(processes + 1)
    results: Queue[tuple[int, Any]] = context.Queue()
    children = [
        context.Process(target=_child, args=(prepare, index, ready, results)) for index in range(processes)
    ]
    for child in children:
        child.start()
    try:
        ready.wait()
        started = time.monotonic()
        answers = dict(results.get(timeout=LONGEST_SECONDS) for _ in children)
    except (BrokenBarrierError, Empty):
        for child in children:
            child.kill()
        raise RuntimeError("One of the processes failed: see what it wrote above.") from None
    seconds = time.monotonic() - started
    for child in children:
        child.join()
    return seconds, [answers[index] for index in range(processes)]


def _child(prepare: Prepare, index: int, ready: Barrier, results: "Queue[tuple[int, Any]]") -> None:
    with threadpool_limits(limits=1):
        try:
            work = prepare(index)
        except BaseException:
            ready.abort()
            raise
        ready.wait()
        results.put((index, work()))
