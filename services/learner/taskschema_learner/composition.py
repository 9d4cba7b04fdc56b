"""The composition root of a training: starts what it needs, runs the loop, and stops everything again."""

import logging
import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from taskschema.arrays import Float32Array
from taskschema.bus.connection import connect
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.learner_life import LearnerLife
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.bus.worker_info import AgentKind
from taskschema.config import RunConfig
from taskschema.errors import ConfigError, RunFolderError
from taskschema.logs import bind
from taskschema.policies import PolicySnapshot
from taskschema.tasks.registry import task_of
from taskschema.tasks.scene_task import SceneTask
from taskschema_learner.api.process import ApiProcess
from taskschema_learner.api.transport import Tls
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_learner.learner import Learner
from taskschema_learner.runs.folder_state import mark_finished
from taskschema_learner.runs.progress import Limits
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import initial_policy_of, published_trunk, trunk_to_bytes
from taskschema_learner.schema_trainers import make_schema_trainer
from taskschema_learner.training import Parts, TrainingContext, TrainingObserver, TrainingStoppedError, train
from taskschema_learner.update.algorithms import make_algorithm
from taskschema_learner.views.summaries import SummaryWriter
from taskschema_learner.workers.worker_pool import WorkerPool

log = logging.getLogger("taskschema.learner")

WORKER_REDIS_VARIABLE = "TASKSCHEMA_WORKER_REDIS_URL"
"""Environment variable with the Redis URL that actors use: a user with fewer rights. Unset: the learner's."""
API_REDIS_VARIABLE = "TASKSCHEMA_API_REDIS_URL"
"""Environment variable with the Redis URL that the API uses, of a user with fewer rights. Unset: ours."""


@dataclass(frozen=True)
class TrainOptions:
    """What `taskschema train` was asked to do."""

    config: RunConfig
    run_dir: Path
    """The run's folder; its name is the run's."""
    resume: bool = False
    workers: int | None = None
    """Rollout actors: None: as many as there is capacity; 0: in this process, without Ray."""
    limits: Limits = Limits()
    redis: str | None = None
    """URL of a Redis to use; None: an embedded one inside the run's folder."""
    ray: str | None = None
    """Address of a Ray cluster to use; None: a local one."""
    api: str | None = "127.0.0.1:8420"
    """HOST:PORT of the HTTP API; None: no API."""
    api_tls: Tls | None = None
    """Its certificate and key; None: no TLS."""
    device: str = "cpu"
    """torch device of the learner."""
    agent: AgentKind = "simulation"
    """Who runs the episodes: `simulation` starts workers, `robot` waits for `taskschema-robot run`."""
    trunk: dict[str, Float32Array] | None = None
    """Published weights that a new run's frozen trunk starts with, by name; None: random ones. A resumed run
    keeps its own."""
    initial_policy: PolicySnapshot | None = None
    """Policy whose weights a new run starts with; None: random ones. A resumed run keeps its own."""


def run_training(options: TrainOptions, observer: TrainingObserver) -> bool:
    """Train and return whether the run is finished; False: it was stopped and can be resumed.

    Raises:
        TaskschemaError: for whatever the user can mend; nothing is then left running.
    """
    if options.ray is not None and options.redis is None:
        raise ConfigError("--ray needs --redis: a cluster's workers cannot reach the Redis inside this run.")
    _require_known_methods(options.config)
    _require_renderer(options)
    stop = threading.Event()
    with ExitStack() as stack:
        stack.enter_context(_stopped_by_signals(stop))
        is_new = not options.run_dir.exists()
        folder = open_folder(options)
        stack.enter_context(folder.locked())
        undo = stack.enter_context(ExitStack())  # before training, nothing is in a new folder but its config
        if is_new:
            undo.callback(shutil.rmtree, folder.path, ignore_errors=True)
        bind(run=folder.name)
        url = options.redis or stack.enter_context(EmbeddedRedis(folder.path / "redis")).url
        records = RunRecords(connect(url))
        records.register_run(folder.name, folder.config)
        _forget_obeyed_stop(records, folder.name)
        api_url = url if options.redis is None else os.environ.get(API_REDIS_VARIABLE, url)
        api = None
        if options.api is not None:
            api = stack.enter_context(ApiProcess(api_url, folder.name, options.api, tls=options.api_tls))
        records.set_api(folder.name, api.url if api else None)
        learner = make_learner(options, folder)
        bus = LearnerBus(connect(url), folder.name, folder.config)
        bus.acquire()
        stack.enter_context(LearnerLife(bus))
        crew = stack.enter_context(ExitStack())
        tend_workers, workers = _start_workers(crew, options, url, folder.name)
        context = TrainingContext(
            folder=folder,
            task=task_of(folder.config),
            limits=options.limits,
            workers=workers,
            agent=options.agent,
            api_url=api.url if api else None,
            api_token=api.token if api and api.token_is_generated else None,
        )
        parts = Parts(
            context=context,
            learner=learner,
            bus=bus,
            records=records,
            observer=observer,
            summaries=stack.enter_context(
                SummaryWriter(folder.path / "tensorboard", rounds_done=len(folder.read_metrics()))
            ),
            tend_workers=tend_workers,
        )
        undo.pop_all()
        return _train_to_the_end(parts, stop, crew)


def _require_known_methods(config: RunConfig) -> None:
    """Refuse names of an algorithm or a schema trainer that are not registered.

    Raises:
        UnknownNameError: that lists those that are.

    """
    make_algorithm(config.ppo)
    make_schema_trainer(config.schema)


def _require_renderer(options: TrainOptions) -> None:
    """Refuse to start workers here that cannot draw what they are to see: each would end at once, and again.

    A cluster's machines have renderers of their own, which nothing here can look at.

    Raises:
        RenderingError: that says what to install.
        ConfigError: if nothing shows how the task looks, or its looks cannot vary.

    """
    config = options.config
    elsewhere = options.ray is not None or options.agent == "robot"
    if config.observation != "image" or elsewhere:
        return
    task = task_of(config)
    if isinstance(task, SceneTask):
        from taskschema_worker.rendering.backend import working_backend

        working_backend()
    else:
        from taskschema_worker.environments import environment_of

        environment_of(config, task).close()


def _forget_obeyed_stop(records: RunRecords, run: str) -> None:
    """Let a run that ended go on. A request that nobody has obeyed yet stands: its learner may have died."""
    if records.stop_requested(run) and records.status(run).state in ("stopped", "finished"):
        records.clear_requests(run)


def _train_to_the_end(parts: Parts, stop: threading.Event, crew: ExitStack) -> bool:
    try:
        with crew:  # workers that cannot be stopped are a failure, not an end
            reason = train(parts, stop)
        mark_finished(parts.context.folder, parts.learner.version, reason)
    except TrainingStoppedError:
        parts.bus.set_state("stopped")
        parts.observer.on_finish("it was asked to stop", finished=False)
        return False
    except Exception:
        parts.bus.set_state("failed")
        raise
    parts.bus.set_state("finished", reason)
    parts.observer.on_finish(reason, finished=True)
    return True


def open_folder(options: TrainOptions) -> RunFolder:
    """Create the run's folder, or open it to resume.

    Raises:
        RunFolderError: if it is not there to resume, is there already, or belongs to another config, kind of
            agent or device.
    """
    if not options.resume:
        initial, trunk = options.initial_policy, options.trunk
        return RunFolder.create(
            options.run_dir,
            options.config,
            initial_policy=None if initial is None else initial.to_bytes(),
            trunk=None if trunk is None or initial is not None else trunk_to_bytes(trunk),
            agent=options.agent,
            device=options.device,
        )
    folder = RunFolder.open(options.run_dir)
    if folder.config != options.config:
        difference = _difference(folder.config, options.config)
        raise RunFolderError(
            f"{options.run_dir} belongs to a run of another config ({difference}): "
            "resume it with the options it was started with, or choose another --run-dir."
        )
    kept = {"agent": folder.agent, "device": folder.device}
    for name, there in kept.items():
        here = getattr(options, name)
        if there not in (None, here):
            raise RunFolderError(
                f"{options.run_dir} is a run with --{name} {there}: resume it without --{name} {here}."
            )
    return folder


def make_learner(options: TrainOptions, folder: RunFolder) -> Learner:
    """Return the run's learner with its first weights; what is not drawn is kept in the folder.

    Raises:
        TaskschemaError: if something of it is gone or damaged, or the device is not there.
    """
    trunk = published_trunk(folder) if options.trunk is None else options.trunk
    initial = initial_policy_of(folder)
    return Learner(folder.config, task_of(folder.config), options.device, trunk, initial)


def _difference(old: RunConfig, new: RunConfig) -> str:
    fields = [name for name in old.__struct_fields__ if getattr(old, name) != getattr(new, name)]
    return ", ".join(f"{name}: there {getattr(old, name)!r}, here {getattr(new, name)!r}" for name in fields)


def _start_workers(
    stack: ExitStack, options: TrainOptions, url: str, run: str
) -> tuple[Callable[[], object], int | None]:
    """Start rollout actors, or a worker here; return what tends them and how many actors there are to be.

    Robots are not started from here: their agent joins the run by itself.
    """
    if options.agent == "robot":
        return lambda: None, None
    if options.workers == 0:
        from taskschema_worker.worker import Worker

        bus = stack.enter_context(WorkerBus(connect(url), run, f"inline-{os.getpid()}"))
        worker = Worker(bus, threads=os.cpu_count() or 1)
        stack.callback(worker.close)
        return lambda: worker.run_once(block_ms=1), None
    actors_url = None if options.redis is None else os.environ.get(WORKER_REDIS_VARIABLE)
    pool = WorkerPool(url, run, options.workers, options.ray, actors_redis_url=actors_url)
    stack.enter_context(pool)
    return pool.check, pool.size


@contextmanager
def _stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """Let SIGINT and SIGTERM ask for a clean stop; a second SIGINT interrupts at once."""

    def request(number: int, frame: FrameType | None) -> None:
        if stop.is_set() and number == signal.SIGINT:
            raise KeyboardInterrupt
        stop.set()

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, request) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
