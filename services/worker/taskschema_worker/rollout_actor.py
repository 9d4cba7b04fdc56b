"""What Ray places and restarts: a process that runs one rollout worker."""

import os
import socket
import threading

import psutil

from taskschema.bus.connection import connect
from taskschema.bus.worker_bus import WorkerBus
from taskschema.logs import FORMAT_VARIABLE, bind, log_format, log_to_stderr


class RolloutActor:
    """One worker in one process; trajectories go to Redis, nothing but its memory travels through Ray.

    Args:
        redis_url: Redis of the run.
        run: the run's name.
        name: ends the worker's id, also after a restart elsewhere.
        cores: part of a core that it has to itself.

    """

    def __init__(self, redis_url: str, run: str, name: str, cores: float) -> None:
        log_to_stderr(log_format(os.environ.get(FORMAT_VARIABLE, "text")))
        self._redis_url = redis_url
        self._run = run
        self._name = name
        self._cores = cores
        self._stop = threading.Event()

    def run(self) -> None:
        """Run slots until told to stop; Ray calls it again after a restart.

        Raises:
            BusError: if Redis refuses, or the run is not there.

        """
        # Here, for a learner names this class to Ray and has none of the simulator's packages.
        from taskschema_worker.environments import spare_graphics
        from taskschema_worker.worker import Worker

        worker_id = f"{socket.gethostname()}-{os.getpid()}-{self._name}"
        bind(run=self._run, worker=worker_id)
        bus = WorkerBus(connect(self._redis_url), self._run, worker_id, cores=self._cores)
        spare_graphics(bus.join())
        Worker(bus).run(self._stop)

    def stop(self) -> None:
        """Let the worker finish its slots and leave."""
        self._stop.set()

    def memory(self) -> int:
        """Return the memory that is this process's own [bytes]."""
        return int(psutil.Process().memory_full_info().uss)
