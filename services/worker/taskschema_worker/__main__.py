"""`python -m taskschema_worker`: one rollout worker without Ray."""

import argparse
import logging
import os
import signal
import socket
import sys
import threading
import uuid
from collections.abc import Sequence
from types import FrameType

from threadpoolctl import threadpool_limits

from taskschema.bus.connection import connect
from taskschema.bus.url import REDIS_VARIABLE, hide_password
from taskschema.bus.worker_bus import LEASE_SECONDS, WorkerBus
from taskschema.errors import BusError, TaskschemaError, UnknownNameError
from taskschema.logs import FORMAT_VARIABLE, bind, log_format, log_to_stderr
from taskschema_worker.environments import spare_graphics
from taskschema_worker.worker import RETRY_SECONDS, Worker

log = logging.getLogger("taskschema.worker")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a worker until SIGTERM or SIGINT; return the exit status."""
    if arguments is None:
        hide_password()
    options = _parser().parse_args(arguments)
    stop = threading.Event()

    def request_stop(number: int, frame: FrameType | None) -> None:
        stop.set()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, request_stop)
    try:
        log_to_stderr(log_format(options.log_format))
        # Workers share the cores, and threads only slow these small products down.
        with threadpool_limits(limits=1):
            worker = _start(options, stop)
            if worker is not None:
                worker.run(stop)
    except TaskschemaError as error:
        print(f"taskschema_worker: {error}", file=sys.stderr)
        return 1
    return 0


def _start(options: argparse.Namespace, stop: threading.Event) -> Worker | None:
    """Join the run once Redis and the run are there; None if told to stop before."""
    worker_id = f"{socket.gethostname()}-{os.getpid()}-{uuid.uuid4().hex[:6]}"
    bind(run=options.run, worker=worker_id)
    waited = 0.0
    while not stop.is_set():
        try:
            bus = WorkerBus(
                connect(options.redis), options.run, worker_id, lease_seconds=options.lease_seconds
            )
            spare_graphics(bus.join())
            return Worker(bus, options.threads)
        except (BusError, UnknownNameError) as error:
            if waited >= options.wait:
                raise
            if waited == 0:
                log.warning("%s Waiting up to %g s for it.", error, options.wait)
        waited += RETRY_SECONDS
        stop.wait(RETRY_SECONDS)
    return None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m taskschema_worker", description=__doc__)
    parser.add_argument(
        "--redis",
        default=os.environ.get(REDIS_VARIABLE),
        required=REDIS_VARIABLE not in os.environ,
        metavar="URL",
        help=f"Redis of the run; better given as {REDIS_VARIABLE}, where nobody else sees its password",
    )
    parser.add_argument("--run", required=True, help="name of the run to serve")
    parser.add_argument("--threads", type=int, default=1, help="physics threads (default: 1)")
    parser.add_argument(
        "--wait",
        type=float,
        default=60.0,
        metavar="SECONDS",
        help="how long to wait for Redis and for the run to be there (default: 60)",
    )
    parser.add_argument(
        "--lease-seconds",
        type=float,
        default=LEASE_SECONDS,
        metavar="SECONDS",
        help=f"take over slots of workers silent for this long (default: {LEASE_SECONDS:g})",
    )
    parser.add_argument(
        "--log-format",
        default=os.environ.get(FORMAT_VARIABLE, "text"),
        metavar="text|json",
        help="text: for people; json: a line of JSON for every event",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
