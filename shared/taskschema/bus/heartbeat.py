"""An agent's signs of life: they say that it is there, and keep its leases from expiring."""

import contextlib
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Collection, Iterable
from datetime import UTC, datetime
from typing import Any

import msgspec
import redis

from taskschema.bus.keys import GROUP, RunKeys
from taskschema.bus.worker_info import AgentKind, WorkerInfo

INTERVAL_SECONDS = 1.0
"""Time between two signs of life [s]."""
RATE_SECONDS = 10.0
"""Episodes per second are counted over about this long [s]."""


class Heartbeat:
    """A thread, so that a long simulation does not keep it from beating."""

    def __init__(self, client: redis.Redis, keys: RunKeys, worker_id: str, kind: AgentKind) -> None:
        self._client: Any = client  # redis-py types every answer as a union with its asyncio twin's
        self._keys = keys
        self._worker_id = worker_id
        self._kind = kind
        self._since = datetime.now(UTC).isoformat(timespec="seconds")
        self._held: set[bytes] = set()
        self._episodes = 0
        self._delivered: deque[tuple[float, int]] = deque([(time.monotonic(), 0)])
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"heartbeat of {worker_id}", daemon=True)

    def start(self) -> None:
        """Give the first sign of life, then one a second."""
        self._beat()
        self._thread.start()

    def stop(self) -> None:
        """Stop, and let everybody see at once that the agent is gone."""
        self._stop.set()
        self._thread.join(INTERVAL_SECONDS)
        with self._client.pipeline(transaction=True) as pipe:
            pipe.hdel(self._keys.workers, self._worker_id)
            pipe.zrem(self._keys.heartbeats, self._worker_id)
            pipe.execute()

    def hold(self, entry_ids: Iterable[bytes]) -> None:
        """Renew these leases from now on."""
        with self._lock:
            self._held.update(entry_ids)

    def release(self, entry_ids: Collection[bytes], episodes: int) -> None:
        """Let these leases go, for whose slots so many episodes were delivered."""
        with self._lock:
            self._held.difference_update(entry_ids)
            self._episodes += episodes
            self._delivered.append((time.monotonic(), self._episodes))
            while len(self._delivered) > 2 and self._delivered[1][0] < time.monotonic() - RATE_SECONDS:
                self._delivered.popleft()

    def _run(self) -> None:
        while not self._stop.wait(INTERVAL_SECONDS):
            # A Redis that is away is noticed where work is leased; here the next beat tries again.
            with contextlib.suppress(redis.RedisError):
                self._beat()

    def _beat(self) -> None:
        seconds, microseconds = self._client.time()
        with self._lock:
            info, held = self._info(), list(self._held)
        with self._client.pipeline(transaction=False) as pipe:
            pipe.hset(self._keys.workers, self._worker_id, msgspec.json.encode(info))
            pipe.zadd(self._keys.heartbeats, {self._worker_id: seconds + microseconds / 1e6})
            if held:
                pipe.xclaim(self._keys.work, GROUP, self._worker_id, 0, held, justid=True)
            pipe.execute()

    def _info(self) -> WorkerInfo:
        start, before = self._delivered[0]
        return WorkerInfo(
            id=self._worker_id,
            kind=self._kind,
            host=socket.gethostname(),
            pid=os.getpid(),
            since=self._since,
            last_seen=0.0,
            episodes=self._episodes,
            busy_slots=len(self._held),
            episodes_per_second=round((self._episodes - before) / max(time.monotonic() - start, 1.0), 2),
        )
