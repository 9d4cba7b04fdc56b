"""The Ray that rollout actors run on: a small one of our own, or a cluster that is there already."""

import ipaddress
import logging
import os
import secrets
import shutil
import signal
import socket
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import psutil

from taskschema.errors import RayError
from taskschema_learner.workers.ray_reaper import RayReaper

if TYPE_CHECKING:
    from ray import ObjectRef
    from ray.actor import ActorHandle

log = logging.getLogger("taskschema.pool")

OBJECT_STORE_BYTES = 80 * 2**20
"""About the least that Ray takes; no trajectory goes through it [bytes]."""
KNOCK_SECONDS = 5.0
"""Longest wait for a cluster to take a connection [s]."""
RESTARTS = 10
"""How often Ray restarts an actor whose process dies, before the pool replaces it."""
SINGLE_THREADED = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of actors: more BLAS threads than one are slower here, and give other bits."""
AUTH_MODE = "RAY_AUTH_MODE"
AUTH_TOKEN = "RAY_AUTH_TOKEN"
"""Environment variables by which Ray's servers ask for a secret, and its clients send it."""
QUIET_SETTINGS = {
    # Nothing of what Ray prints here on its own: lines of ours may have to be JSON. Its log files keep it,
    # and the pool says what becomes of the actors.
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".",
    "RAY_USAGE_STATS_ENABLED": "0",
}
"""Environment of this process; Ray reads these when it is first imported."""
LOCAL_SETTINGS = {
    # Ray's switch for laptops makes all its servers listen on loopback alone.
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",
    # Other users of the machine reach loopback, too.
    AUTH_MODE: "token",
    # Idle processes started ahead of time have not the actors' environment and would never be used.
    "RAY_prestart_worker_first_driver": "false",
}
"""Environment of a local Ray, too."""


class Node(NamedTuple):
    """What one machine, or one container, offers to actors."""

    cpus: float
    memory: float
    """[bytes]"""
    host: str = ""
    """Its name, as its workers tell it."""
    is_leaving: bool = False
    """Whether it was told to stop and waits for its actors."""


class RayRuntime:
    """A connection to Ray, which it starts on this machine if it has no address.

    Args:
        address: an existing cluster, such as `auto` or `10.0.0.5:6379`; None: a local Ray.

    """

    def __init__(self, address: str | None = None) -> None:
        self._address = address
        self._folder: Path | None = None
        self._reaper: RayReaper | None = None

    def start(self) -> None:
        """Start or reach Ray.

        Raises:
            RayError: if that fails.

        """
        os.environ.update(QUIET_SETTINGS)
        settings: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}
        if self._address is None:
            os.environ.update(LOCAL_SETTINGS)
            # Ray keeps the first token that a process has: another start in it must use the same.
            os.environ.setdefault(AUTH_TOKEN, secrets.token_hex(32))
            # A folder of its own, short because Unix sockets' paths are; it goes when Ray stops.
            self._folder = Path(tempfile.mkdtemp(prefix="taskschema-"))
            settings |= {
                "address": "local",
                "num_cpus": len(os.sched_getaffinity(0)),
                "include_dashboard": False,
                "object_store_memory": OBJECT_STORE_BYTES,
                "_temp_dir": str(self._folder),
            }
        else:
            self._refuse_open_cluster(_host(self._address))
            self._knock()
            settings |= {"address": self._address, "ignore_reinit_error": True}
        import ray

        others = _child_processes()
        try:
            with _signal_handlers_kept():
                ray.init(**settings)
        except Exception as error:  # bare ones, too, where a start takes longer than Ray waits
            self.stop()
            raise RayError(self._failure(error)) from error
        if self._folder is not None:
            self._reaper = RayReaper(self._folder, _child_processes() - others)
        own = ray.util.get_node_ip_address()  # type: ignore[no-untyped-call]
        if self._address is None and own != "127.0.0.1":
            self.stop()
            raise RayError("Ray would listen beyond this machine: start taskschema before importing ray.")
        if self._address is not None:
            try:
                self._refuse_open_cluster(_host(ray.get_runtime_context().gcs_address))
            except RayError:
                self.stop()
                raise

    def stop(self) -> None:
        """Stop or leave Ray; what was started here is gone then."""
        import ray

        with _signal_handlers_kept(), _native_errors_dropped():
            ray.shutdown()
        if self._reaper is not None:
            self._reaper.reap()
            self._reaper = None
        elif self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
        self._folder = None

    def check(self) -> None:
        """Return if Ray has a living node.

        Raises:
            RayError: if it has none: nothing can be placed any more.
        """
        import ray

        try:
            if any(node["Alive"] for node in ray.nodes()):  # type: ignore[no-untyped-call]
                return
        except (ray.exceptions.RayError, RuntimeError, ConnectionError) as error:
            log.warning("Ray does not answer: %s", " ".join(str(error).split())[:300])
        raise RayError("Ray has died: its workers cannot be replaced. Continue with --resume.")

    def nodes(self) -> list[Node]:
        """Return the cluster's living nodes."""
        import ray

        # What Ray Train asks too: ray.nodes() does not say it.
        leaving = ray._private.state.state.get_draining_nodes()
        found = [node for node in ray.nodes() if node["Alive"]]  # type: ignore[no-untyped-call]
        return [
            Node(
                cpus=node["Resources"].get("CPU", 0.0),
                memory=node["Resources"].get("memory", 0.0),
                host=node["NodeManagerHostname"],
                is_leaving=node["NodeID"] in leaving,
            )
            for node in found
        ]

    def start_actor(self, redis_url: str, run: str, name: str, cpus: float) -> "ActorHandle[Any]":
        """Place a rollout actor, on another machine than the one before if there is one."""
        import ray

        from taskschema_worker import WITHOUT_GYMNASIUM
        from taskschema_worker.rollout_actor import RolloutActor

        remote: Any = ray.remote(RolloutActor)
        options = remote.options(
            num_cpus=cpus,
            max_restarts=RESTARTS,
            max_task_retries=RESTARTS,  # a restarted actor goes on running its worker
            max_concurrency=3,  # run, stop and memory at the same time
            scheduling_strategy="SPREAD",
            runtime_env={"env_vars": {**SINGLE_THREADED, WITHOUT_GYMNASIUM: "1"}},
        )
        handle: ActorHandle[Any] = options.remote(redis_url, run, name, cpus)
        return handle

    def ended(self, references: "Sequence[ObjectRef[None]]") -> "dict[ObjectRef[None], str | None]":
        """Return which of some calls are over, with the error of those that failed, on one line."""
        import ray

        if not references:
            return {}
        ready, _ = ray.wait(list(references), num_returns=len(references), timeout=0)
        result: dict[ObjectRef[None], str | None] = {}
        for reference in ready:
            try:
                ray.get(reference)
            except ray.exceptions.RayTaskError as error:
                result[reference] = f"{type(error.cause).__name__}: {error.cause}".splitlines()[0]
            except ray.exceptions.RayError as error:
                result[reference] = str(error).strip().splitlines()[0]
            else:
                result[reference] = None
        return result

    def answers(self, references: "Sequence[ObjectRef[int]]", timeout: float) -> list[int]:
        """Return the results of those calls that succeed within `timeout` seconds."""
        import ray

        ready, _ = ray.wait(list(references), num_returns=len(references), timeout=timeout)
        results = []
        for reference in ready:
            try:
                results.append(ray.get(reference))
            except ray.exceptions.RayError:  # an actor that is just dying has no memory to tell of
                continue
        return results

    def wait(self, references: "Sequence[ObjectRef[None]]", timeout: float) -> None:
        """Wait until all calls are over, for at most `timeout` seconds."""
        import ray

        if references:
            ray.wait(list(references), num_returns=len(references), timeout=timeout)

    def kill(self, actor: "ActorHandle[Any]") -> None:
        """End an actor's process for good."""
        import ray

        ray.kill(actor, no_restart=True)

    def _refuse_open_cluster(self, host: str) -> None:
        """Return if the cluster's head is on this machine, or asks for a token.

        Raises:
            RayError: if others reach it and it does not: they could run code on it, and on us.
        """
        if os.environ.get(AUTH_MODE, "").lower() == "token" or _is_loopback(host):
            return
        raise RayError(
            f"Ray at {self._address} is reached beyond this machine and asks for no token: start its nodes "
            f"with {AUTH_MODE}=token and a secret in {AUTH_TOKEN}, and set both here."
        )

    def _knock(self) -> None:
        """Try the cluster's port: Ray itself looks for a cluster that is not there for minutes.

        Raises:
            RayError: if nobody answers there.

        """
        host, _, port = (self._address or "").removeprefix("ray://").rpartition(":")
        if not port.isdigit():  # `auto` and the like
            return
        try:
            socket.create_connection((host.strip("[]"), int(port)), timeout=KNOCK_SECONDS).close()
        except OSError as error:
            raise RayError(self._failure(error)) from None

    def _failure(self, error: BaseException) -> str:
        reason = " ".join(str(error).split())[:300].rstrip(".") + "."
        if self._address is not None:
            return (
                f"Ray at {self._address} cannot be reached: {reason} Check the address and that the cluster "
                "has the same versions of Ray and Python."
            )
        return f"Ray cannot be started on this machine: {reason} `taskschema doctor --full` looks for why."


def _host(address: str) -> str:
    """Return the host in `[ray://]HOST:PORT`; loopback for `auto` and the like, where it is not known yet."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    return host.strip("[]") if port.isdigit() else "127.0.0.1"


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _child_processes() -> set[int]:
    return {child.pid for child in psutil.Process().children(recursive=True)}


@contextmanager
def _native_errors_dropped() -> Iterator[None]:
    """Keep what C++ prints off standard error, where each line may have to be JSON.

    While Ray shuts down it complains there of calls that were still running, as those of busy actors are.
    """
    sys.stderr.flush()
    terminal = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(terminal, 2)
        os.close(terminal)
        os.close(nowhere)


@contextmanager
def _signal_handlers_kept() -> Iterator[None]:
    """Keep Ray from replacing this process's own handlers, which stop a training cleanly."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
