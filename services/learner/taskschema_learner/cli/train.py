"""`taskschema train`: learn a task."""

import inspect
import os
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

import typer

from taskschema_learner.cli import train_options as option

if TYPE_CHECKING:
    from taskschema.bus.worker_info import AgentKind
    from taskschema.config import RunConfig
    from taskschema_learner.composition import TrainOptions
    from taskschema_learner.runs.run_folder import RunFolder


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(train)


def train(
    context: typer.Context,
    task: option.Task = None,
    task_file: option.TaskFile = None,
    policy: option.Policy = "schema",
    observation: option.Observation = "state",
    trunk: option.Trunk = "small",
    vgg_weights: option.VggWeights = None,
    randomise_visuals: option.RandomiseVisuals = False,
    seed: option.Seed = 0,
    slots: option.Slots = 50,
    init_schema: option.InitSchema = None,
    freeze_schema: option.FreezeSchema = False,
    schema_public_key: option.SchemaPublicKey = None,
    init_policy: option.InitPolicy = None,
    safety_gate: option.SafetyGate = False,
    settings: option.Settings = None,
    until_success: option.UntilSuccess = 0.9,
    rounds: option.Rounds = None,
    resume: option.Resume = False,
    run_dir: option.RunDir = None,
    agent: option.Agent = "simulation",
    workers: option.Workers = None,
    redis: option.Redis = None,
    ray: option.Ray = None,
    device: option.Device = "cpu",
    api: option.Api = "127.0.0.1:8420",
    api_tls_cert: option.ApiTlsCert = None,
    api_tls_key: option.ApiTlsKey = None,
    log_format: option.LogFormat = "text",
) -> None:
    """Learn a task: which skill each arm runs at each step, and with which arguments.

    Starts everything that it needs, shows how far it is, and ends at 90 % success. Ctrl-C stops it, and
    --resume goes on.
    """
    from taskschema_learner.api.transport import Tls
    from taskschema_learner.cli.image_options import first_weights_sentence, read_trunk, with_image_options
    from taskschema_learner.cli.transfer import require_useful_schema, with_initial_policy

    given = {
        name: value
        for name, value in context.params.items()
        if getattr(context.get_parameter_source(name), "name", "") != "DEFAULT"
    }
    if resume:
        folder = _run_to_resume(run_dir, task, task_file, policy, seed)
        run_dir, config = folder.path, folder.config
        agent = given.get("agent", folder.agent or agent)
        device = given.get("device", folder.device or device)
    else:
        config = _new_config(task, task_file, agent, runs_here=ray is None and agent != "robot")
    tls = Tls.of(api_tls_cert, api_tls_key)
    first_trunk = read_trunk(vgg_weights)
    config = with_image_options(_with_options(config, given), given, first_trunk)
    _require_useful_gate(config, agent)
    if not resume:  # runs of earlier versions go on as they are
        require_useful_schema(config)
    if config.observation == "image" and not resume:
        print(first_weights_sentence(config, vgg_weights))

    # These need torch, which takes seconds to import: what is wrong with the options shows before.
    from taskschema_learner.composition import TrainOptions
    from taskschema_learner.runs.progress import Limits

    trunk_weights = None if first_trunk is None else first_trunk.weights
    config, initial = with_initial_policy(config, init_policy, trunk_weights)
    _run(
        TrainOptions(
            config=config,
            run_dir=run_dir or _new_run_dir(config),
            resume=resume,
            workers=workers,
            limits=Limits(until_success=until_success or None, rounds=rounds),
            redis=redis,
            ray=ray,
            api=None if api == "none" else api,
            api_tls=tls,
            device=device,
            trunk=trunk_weights,
            initial_policy=initial,
            agent=_agent_kind(agent),
        ),
        log_format,
    )


def _agent_kind(name: str) -> "AgentKind":
    """Return who runs the episodes.

    Raises:
        UnknownNameError: if there is no such kind of agent.

    """
    from taskschema.bus.worker_info import AgentKind
    from taskschema.errors import UnknownNameError

    if name not in get_args(AgentKind):
        raise UnknownNameError("agent", name, get_args(AgentKind))
    return cast("AgentKind", name)


def _new_config(task: str | None, task_file: str | None, agent: str, *, runs_here: bool) -> "RunConfig":
    """Return the config of a task with all defaults, for workers or for a robot.

    Raises:
        TaskschemaError: if there is no such task, or one of the user's own is not fit for a run.

    """
    from taskschema_learner.cli.task_reference import own_task, task_and_source
    from taskschema_learner.default_config import default_config, robot_config

    name, source = task_and_source(task, task_file)
    if task_file is not None:
        own_task(task_file, runs_here=runs_here)
    config = default_config(name, task_source=source)
    return robot_config(config) if _agent_kind(agent) == "robot" else config


def _run_to_resume(
    run_dir: Path | None, task: str | None, task_file: str | None, policy: str, seed: int
) -> "RunFolder":
    """Open the run that `--resume` means: --run-dir, or the newest of this task, policy and seed."""
    from taskschema.errors import ConfigError
    from taskschema_learner.cli.run_reference import newest_run_dir
    from taskschema_learner.runs.run_folder import RunFolder

    if run_dir is None:
        name = task if task_file is None else task_file.rpartition(":")[2]
        if name is None:
            raise ConfigError("Say which run to resume: TASK, or --run-dir FOLDER.")
        run_dir = newest_run_dir(name, policy, seed)
    return RunFolder.open(run_dir)


def _new_run_dir(config: "RunConfig") -> Path:
    from taskschema_learner.cli.run_reference import new_run_dir

    return new_run_dir(config.task, config.policy, config.seed)


def _with_options(config: "RunConfig", given: Mapping[str, Any]) -> "RunConfig":
    """Return the config with what stands on the command line; defaults change nothing.

    Raises:
        TaskschemaError: for whatever cannot be used.

    """
    import msgspec

    from taskschema.config import ObservationKind, PolicyKind, override
    from taskschema.errors import ConfigError, UnknownNameError
    from taskschema.tasks.registry import read_task_file
    from taskschema_learner.cli.transfer import initial_logits

    changes = {
        name: given[name]
        for name in ("task", "policy", "observation", "seed", "slots", "safety_gate")
        if name in given
    }
    for name, kinds in (("policy", PolicyKind), ("observation", ObservationKind)):
        if name in changes and changes[name] not in get_args(kinds):
            raise UnknownNameError(name, changes[name], get_args(kinds))
    if "task_file" in given:
        changes["task"], changes["task_source"] = read_task_file(given["task_file"])
    schema: dict[str, Any] = {}
    if "init_schema" in given:
        schema["initial_logits"] = initial_logits(
            given["init_schema"], config, given.get("schema_public_key")
        )
    if "freeze_schema" in given:
        schema["frozen"] = given["freeze_schema"]
    changes["schema"] = msgspec.structs.replace(config.schema, **schema)
    changed = msgspec.structs.replace(config, **changes)
    assignments = {}
    for text in given.get("settings") or ():
        field, separator, value = text.partition("=")
        if not separator:
            raise ConfigError(f"--set takes FIELD=VALUE, such as ppo.learning_rate=0.005; got {text!r}.")
        if field == "image.vgg_sha256":
            raise ConfigError("image.vgg_sha256 is not for --set: --vgg-weights FILE writes it.")
        assignments[field] = value
    return override(changed, assignments)


def _require_useful_gate(config: "RunConfig", agent: str) -> None:
    """Refuse a gate in simulation where nothing is simulated, or nothing has arms.

    Raises:
        ConfigError: that says so.

    """
    from taskschema.errors import ConfigError
    from taskschema.tasks.registry import task_of
    from taskschema.tasks.scene_task import with_arms

    if not config.safety_gate:
        return
    if agent == "robot":
        raise ConfigError("A robot's own gate checks every motion: --safety-gate is for simulation alone.")
    with_arms(task_of(config))


def _run(options: "TrainOptions", log_kind: str) -> None:
    from rich.console import Console

    from taskschema.logs import FORMAT_VARIABLE, log_format
    from taskschema_learner.composition import run_training
    from taskschema_learner.logs import RunLog
    from taskschema_learner.views.log_observer import LogObserver
    from taskschema_learner.views.terminal import TerminalObserver

    kind = log_format(log_kind)
    os.environ[FORMAT_VARIABLE] = kind  # for the workers that are started here
    console = Console(highlight=False)
    run_log = RunLog(console, kind)
    again = _resume_command(options, kind)
    observer: LogObserver | TerminalObserver = LogObserver(run_log, again)
    if kind == "text":
        observer = TerminalObserver(console, run_log, again, options.config.policy)
    try:
        run_training(options, observer)
    finally:
        observer.close()


def _resume_command(options: "TrainOptions", log_kind: str) -> str:
    """Return what goes on with the run in the same way: with every option that is not its default.

    Secrets in the Redis URL are left for the person to fill in.
    """
    tls = options.api_tls
    values = {
        "until_success": options.limits.until_success or 0,
        "rounds": options.limits.rounds,
        "agent": options.agent,
        "workers": options.workers,
        "redis": "URL" if "@" in (options.redis or "") else options.redis,
        "ray": options.ray,
        "device": options.device,
        "api": options.api or "none",
        "api_tls_cert": None if tls is None else tls.certificate,
        "api_tls_key": None if tls is None else tls.key,
        "log_format": log_kind,
    }
    defaults = inspect.signature(train).parameters
    words = ["taskschema", "train", "--resume", "--run-dir", str(options.run_dir)]
    for name, value in values.items():
        if value != defaults[name].default:
            words += [f"--{name.replace('_', '-')}", str(value)]
    return shlex.join(words)
