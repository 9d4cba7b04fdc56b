"""The worker pool: places, restarts and scales rollout actors on Ray."""

import logging
import math
import threading
import time
import uuid
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.errors import BusError, RayError
from taskschema_learner.workers.ray_runtime import Node, RayRuntime

if TYPE_CHECKING:
    from ray import ObjectRef
    from ray.actor import ActorHandle

log = logging.getLogger("taskschema.pool")

ACTORS_PER_CORE = 64
"""Most actors that one core is shared by."""
BYTES_PER_ACTOR = 150 * 2**20
"""Memory set aside for an actor when counting how many fit [bytes]."""
POLL_SECONDS = 0.5
"""How often the target is read and dead actors are looked for [s]."""
REPORT_SECONDS = (20.0, 300.0)
"""When the workers' memory is logged first, and how often later [s]."""
GRACE_SECONDS = 10.0
"""How long an actor that is one too many may finish its slots [s]."""
RETRY_SECONDS = (1.0, 30.0)
"""Shortest and longest wait before failed workers are replaced; it doubles with each failure in a row [s]."""
CLOSE_SECONDS = 0.8
"""How long actors may take to leave when the pool closes [s]."""


@dataclass
class _Actor:
    handle: "ActorHandle[Any]"
    running: "ObjectRef[None]"
    name: str
    """Ends the id of its worker."""
    share: float
    """CPUs that Ray reserves for it."""
    retired_at: float | None = None
    """When it was asked to leave."""


class WorkerPool:
    """Rollout actors of one run, as many as its target asks for and the cluster can hold.

    actors = min(target, capacity), and the target is the capacity, one actor a core, unless someone set it:
    here, with `taskschema scale N` or with `PUT /workers`. Where actors outnumber cores, each reserves a
    fraction of one, down to 1/64. Nodes of the cluster may come and go: the actors of one that was told to
    stop finish their slots and move. An actor whose process dies is restarted by Ray, one whose worker fails
    by the pool. Use it in `with`; leaving it stops all actors, and Ray if it was started here.

    Raises:
        BusError: if Redis cannot be reached. RayError: if Ray cannot be started or reached.

    """

    def __init__(
        self,
        redis_url: str,
        run: str,
        target: int | None = None,
        address: str | None = None,
        actors_redis_url: str | None = None,
    ) -> None:
        """Describe the pool.

        Args:
            redis_url: Redis of the run.
            run: the run's name.
            target: how many actors there are to be from now on; None: leave it as it is.
            address: an existing Ray cluster; None: a local Ray.
            actors_redis_url: the same Redis for a user with an actor's rights; None: `redis_url`.

        """
        self._actors_redis_url = redis_url if actors_redis_url is None else actors_redis_url
        self._run = run
        self._records = RunRecords(connect(redis_url))
        if target is not None:
            self._records.set_worker_target(run, target)
        self._ray = RayRuntime(address)
        self._actors: list[_Actor] = []
        self._failures = 0
        self._retry_at = 0.0
        self._failure: RayError | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._follow_target, name="worker-pool", daemon=True)

    def __enter__(self) -> Self:
        """Start Ray and the first actors; they join the run when they are up."""
        self._ray.start()
        try:
            self._reconcile()
        except BaseException:
            self._ray.stop()
            raise
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop everything, within five seconds."""
        self.close()

    @property
    def size(self) -> int:
        """How many actors there are to be now."""
        return sum(actor.retired_at is None for actor in self._actors)

    @property
    def capacity(self) -> int:
        """How many actors the cluster can hold at the most, however many are asked for."""
        staying = [node for node in self._ray.nodes() if not node.is_leaving]
        return max(1, places(staying, ACTORS_PER_CORE))

    def check(self) -> None:
        """Return if workers are there, or can be started again.

        Raises:
            RayError: if Ray itself is gone.
        """
        if self._failure is not None:
            raise self._failure

    def memory(self) -> list[int]:
        """Return each actor's own memory [bytes], of those that answer within a second."""
        return self._ray.answers([actor.handle.memory.remote() for actor in self._actors], timeout=1.0)

    def close(self) -> None:
        """Stop all actors, and Ray if it was started here."""
        if self._closing.is_set():
            return
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        for actor in self._actors:
            actor.handle.stop.remote()
        self._ray.wait([actor.running for actor in self._actors], timeout=CLOSE_SECONDS)
        # Whoever has not left ends with the connection to Ray; killed one by one, each would be reported.
        self._actors.clear()
        self._ray.stop()

    def _follow_target(self) -> None:
        """Keep the actors at their target until the pool closes."""
        report_at = time.monotonic() + REPORT_SECONDS[0]
        while not self._closing.wait(POLL_SECONDS):
            try:
                self._reconcile()
                if time.monotonic() >= report_at:
                    self._report_memory()
                    report_at = time.monotonic() + REPORT_SECONDS[1]
            except BusError as error:  # Redis may come back; the actors try again by themselves
                log.warning("The worker target cannot be read: %s", error)
            except RayError as error:
                self._failure = error
                return

    def _report_memory(self) -> None:
        sizes = self.memory()
        if sizes:
            log.info("memory of %d workers: at most %.0f MB of its own each", len(sizes), max(sizes) / 1e6)

    def _reconcile(self) -> None:
        """Drop actors that ended, retire those that are too many or reserve too much, start missing ones."""
        self._ray.check()
        nodes = self._ray.nodes()
        staying = [node for node in nodes if not node.is_leaving]
        target = self._records.worker_target(self._run)
        cores = max(1, sum(int(node.cpus) for node in staying))
        capacity = max(1, places(staying, ACTORS_PER_CORE))
        wanted = min(cores if target is None else target, capacity)
        share = share_of_core(staying, wanted)
        self._drop_ended()
        before = self.size
        self._retire(wanted, share, {node.host for node in nodes if node.is_leaving})
        if time.monotonic() >= self._retry_at:
            self._actors += [self._start(share) for _ in range(wanted - self.size)]
        if self.size != before:
            log.info(
                "workers: %d, each on %g CPU (target %s, capacity %d)",
                self.size,
                share,
                target,
                capacity,
            )

    def _retire(self, wanted: int, share: float, leaving: Collection[str]) -> None:
        """Let go actors that reserve more than `share` of a core, whose host leaves, or beyond `wanted`."""
        staying = [actor for actor in self._actors if actor.retired_at is None and actor.share <= share]
        if leaving or len(staying) > wanted:
            workers = self._records.workers(self._run)
            hosts = {info.id.rpartition("-")[2]: info.host for info in workers}
            staying = [actor for actor in staying if hosts.get(actor.name) not in leaving]
            # An actor whose node is gone waits for room on another: it goes before one that works.
            staying.sort(key=lambda actor: actor.name not in hosts)
        for actor in self._actors:
            if actor.retired_at is None and actor not in staying[:wanted]:
                actor.handle.stop.remote()
                actor.retired_at = time.monotonic()

    def _start(self, share: float) -> _Actor:
        name = uuid.uuid4().hex[:8]
        handle = self._ray.start_actor(self._actors_redis_url, self._run, name, share)
        return _Actor(handle, handle.run.remote(), name, share)

    def _drop_ended(self) -> None:
        """Forget actors that left or failed, and kill those that take too long to leave."""
        now = time.monotonic()
        ended = self._ray.ended([actor.running for actor in self._actors])
        for actor in list(self._actors):
            overdue = actor.retired_at is not None and now - actor.retired_at > GRACE_SECONDS
            if actor.running not in ended and not overdue:
                continue
            self._ray.kill(actor.handle)
            self._actors.remove(actor)
            failure = ended.get(actor.running)
            if failure is not None and actor.retired_at is None:
                self._delay_retry(failure)

    def _delay_retry(self, failure: str) -> None:
        """Note a worker's failure: what fails at once when it is replaced must not be replaced for ever."""
        now = time.monotonic()
        shortest, longest = RETRY_SECONDS
        self._failures = self._failures + 1 if now - self._retry_at < longest else 1
        self._retry_at = now + min(longest, shortest * 2.0 ** (self._failures - 1))
        log.warning("A worker failed and is replaced in %.0f s: %s", self._retry_at - now, failure)


def places(nodes: Sequence[Node], per_core: int) -> int:
    """Return how many actors fit, at most `per_core` on a core; none spans two nodes."""
    return sum(min(int(node.cpus * per_core), int(node.memory / BYTES_PER_ACTOR)) for node in nodes)


def share_of_core(nodes: Sequence[Node], actors: int) -> float:
    """Return the part of a core that each of so many actors reserves: 1, or the largest 1/k that fits all."""
    fitting = (k for k in range(1, ACTORS_PER_CORE + 1) if places(nodes, k) >= actors)
    return math.floor(1e4 / next(fitting, ACTORS_PER_CORE)) / 1e4
