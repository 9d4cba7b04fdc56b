"""A rollout worker: leases slots, runs them on the policy they ask for, delivers them."""

import contextlib
import logging
import threading
from concurrent.futures import ThreadPoolExecutor

from taskschema.bus.lease import Lease
from taskschema.bus.worker_bus import WorkerBus
from taskschema.errors import BusError, FrameError
from taskschema.policies import ActingPolicy, policy_of
from taskschema.tasks.registry import task_of
from taskschema.trajectory import Trajectory
from taskschema_worker.environments import environment_of
from taskschema_worker.rollout import collect_slots

log = logging.getLogger("taskschema.worker")

BLOCK_MS = 1_000
"""An idle worker looks this often whether leases expired and whether it is to stop [ms]."""
RETRY_SECONDS = 1.0
"""Time before the next try when Redis does not answer [s]."""
SEEN_SLOTS = 8
"""Slots on images that are run together: while their 19 MB travel, the next ones are simulated and drawn."""

Finished = tuple[Lease, list[Trajectory]]
Unseen = tuple[Lease, str]
"""A slot that cannot be run, and what is wrong with its frame."""


class Worker:
    """Runs slots of the bus's run, until told to stop or, with `run_once`, one batch at a time.

    Raises:
        BusError: if Redis does not answer; UnknownNameError, if the run is not there.

    """

    def __init__(self, bus: WorkerBus, threads: int = 1) -> None:
        self._bus = bus
        self._config = bus.join()
        self._task = task_of(self._config)
        self._environment = environment_of(self._config, self._task, threads)
        self._undelivered: list[Finished] = []
        self._unseen: list[Unseen] = []

    def run(self, stop: threading.Event) -> None:
        """Run slots until `stop` is set; waits for a Redis that is away and then goes on.

        Raises:
            ConfigError: if the run was replaced by one of another config.

        """
        log.info("Worker %s serves a run of %s", self._bus.worker_id, self._task.name)
        try:
            while not stop.is_set():
                try:
                    self.run_once(BLOCK_MS)
                except BusError as error:
                    log.warning("%s Trying again.", error)
                    stop.wait(RETRY_SECONDS)
        finally:
            self.close()

    def run_once(self, block_ms: int) -> int:
        """Lease slots, waiting up to `block_ms` [ms] for some; run and deliver them; return how many.

        What could not be delivered because Redis was away is delivered first, next time.
        """
        self._deliver()
        leases = self._bus.lease(block_ms)
        if leases:
            self._run_parts(leases, policy_of(self._config, self._task, self._bus.policy(leases[0])))
            self._deliver()
        return len(leases)

    def _run_parts(self, leases: list[Lease], policy: ActingPolicy) -> None:
        """Run slots; on images part by part, each of which travels while the next is simulated and drawn.

        The bus is the sender's until it is done. Of what it could not send nothing is lost: it stays with
        what is finished, and is sent with the next part.
        """
        size = SEEN_SLOTS if self._config.observation == "image" else len(leases)
        with ThreadPoolExecutor(1, "sender") as sender:
            for start in range(0, len(leases), size):
                sending = sender.submit(self._try_to_deliver) if start else None
                finished, unseen = self._collect(leases[start : start + size], policy)
                if sending is not None:
                    sending.result()
                self._undelivered += finished
                self._unseen += unseen

    def _collect(self, leases: list[Lease], policy: ActingPolicy) -> tuple[list[Finished], list[Unseen]]:
        """Run slots as one batch; if a frame is bad, each by itself, to refuse only those that show it."""
        try:
            trajectories = collect_slots(
                self._environment,
                policy,
                seed=self._config.seed,
                round_index=leases[0].item.round,
                slots=[lease.item.slot for lease in leases],
                episodes_per_slot=self._config.episodes_per_slot,
                horizon=self._task.horizon,
            )
        except FrameError as error:
            if len(leases) == 1:
                return [], [(leases[0], str(error))]
            parts = [self._collect([lease], policy) for lease in leases]
            return [item for finished, _ in parts for item in finished], [
                item for _, unseen in parts for item in unseen
            ]
        return list(zip(leases, trajectories, strict=True)), []

    def _try_to_deliver(self) -> None:
        with contextlib.suppress(BusError):  # the next part's turn comes, and then the caller's
            self._deliver()

    def _deliver(self) -> None:
        for lease, reason in self._unseen:
            log.warning("Slot %d cannot be run: %s", lease.item.slot, reason, extra=_about([lease]))
        self._bus.refuse(self._unseen)
        leases = [lease for lease, _ in self._undelivered]
        self._bus.submit(self._undelivered)
        if leases:
            log.info("Delivered %d slots", len(leases), extra=_about(leases))

    def close(self) -> None:
        """Leave the run and free the environment."""
        try:
            self._bus.leave()
        except BusError as error:
            log.warning("%s The leases expire by themselves.", error)
        self._environment.close()


def _about(leases: list[Lease]) -> dict[str, object]:
    """Return what a line of the log says about slots."""
    return {"round": leases[0].item.round, "slots": [lease.item.slot for lease in leases]}
