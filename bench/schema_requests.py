"""Row 9: `GET /schema` at 200 requests per second while training, and how much that slows the training."""

import multiprocessing
import socket
import threading
import time
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Event

import numpy as np

from bench.entry import Entry
from bench.service_process import ServiceProcess, seconds

RATE = 200.0
"""Requests per second of all connections together."""
CONNECTIONS = 16
WORKERS = 2
ROUNDS = 3
"""Rounds with, and as many without requests, a repeat."""


def measure(repeats: int, rounds: int = ROUNDS) -> list[Entry]:
    percentiles, slowdowns, served, asked = [], [], [], []
    with ServiceProcess(WORKERS) as service:
        service.wait_for_workers()
        for _ in range(repeats):
            quiet = seconds(service.wait_for_rounds(rounds))
            before = service.api_seconds()
            with _Requests(service.port) as requests:
                busy = seconds(service.wait_for_rounds(rounds))
            count = len(requests.latencies)
            served.append(1e6 * (service.api_seconds() - before) / count)
            asked.append(1e6 * requests.processor_seconds / count)
            percentiles.append(float(np.percentile(requests.latencies, 99)))
            slowdowns.append(100 * (busy / quiet - 1))
            print(
                f"  {count} requests, p99 {percentiles[-1]:.1f} ms, {slowdowns[-1]:+.1f} %, "
                f"API {served[-1]:.0f} us and clients {asked[-1]:.0f} us of processor time a request"
            )
    return [
        Entry.of(9, "GET /schema at 200/s while training, p99", percentiles, "ms", 25, "lower"),
        Entry.of(9, "training slowed by it, clients on the same cores", slowdowns, "%", 5, "lower"),
        Entry.of(9, "processor time of the API a request", served, "us", None, "lower"),
        Entry.of(
            9, "processor time of the clients a request, part of the slowdown", asked, "us", None, "lower"
        ),
    ]


class _Requests:
    """Asks for the schema at a fixed rate from another process, while it is entered."""

    def __init__(self, port: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._stop: Event = context.Event()
        self._queue: Queue[tuple[list[float], float]] = context.Queue()
        self._process = context.Process(target=_ask, args=(port, self._stop, self._queue))
        self.latencies: list[float] = []
        """From when each request was due until it was answered [ms]."""
        self.processor_seconds = 0.0
        """What asking took of the cores [s]."""

    def __enter__(self) -> "_Requests":
        self._process.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self.latencies, self.processor_seconds = self._queue.get(timeout=60)
        self._process.join()


def _ask(port: int, stop: Event, queue: "Queue[tuple[list[float], float]]") -> None:
    latencies: list[float] = []
    processor = time.process_time()
    start = time.monotonic() + 0.1
    threads = [
        threading.Thread(target=_connection, args=(port, start + index / RATE, stop, latencies))
        for index in range(CONNECTIONS)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    queue.put((latencies, time.process_time() - processor))


def _connection(port: int, due: float, stop: Event, latencies: list[float]) -> None:
    request = f"GET /schema HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()
    with socket.create_connection(("127.0.0.1", port), timeout=30) as connection:
        while not stop.is_set():
            time.sleep(max(0.0, due - time.monotonic()))
            connection.sendall(request)
            _read_answer(connection)
            # A late answer delays the next request; counted from when it was due, that is not forgotten.
            latencies.append(1e3 * (time.monotonic() - due))
            due += CONNECTIONS / RATE


def _read_answer(connection: socket.socket) -> None:
    """Read one whole answer, with as little work as possible: the clients take of the same cores.

    Raises:
        RuntimeError: if it is not 200.
    """
    data = _received(connection)
    while b"\r\n\r\n" not in data:
        data += _received(connection)
    head, _, body = data.partition(b"\r\n\r\n")
    if not head.startswith(b"HTTP/1.1 200 "):
        raise RuntimeError(f"GET /schema answered {head[:80]!r}")
    length = head.lower().partition(b"\r\ncontent-length:")[2].partition(b"\r\n")[0]
    while len(body) < int(length):
        body += _received(connection)


def _received(connection: socket.socket) -> bytes:
    """Return what came.

    Raises:
        ConnectionError: if the connection was closed.
    """
    data = connection.recv(65536)
    if not data:
        raise ConnectionError("The API closed a connection in the middle of an answer.")
    return data
