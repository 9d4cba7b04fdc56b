"""The composition root of the agent: connects arms, gate, world and run, and serves until it is over."""

import logging
import re
import socket
import threading
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.errors import ConfigError
from taskschema.tasks.registry import task_of
from taskschema.tasks.scene_task import SceneTask
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.operator import Operator
from taskschema_robot.agent.robot_agent import LEASE_SECONDS, RobotAgent
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.cli.arms import robot_hardware, twin_hardware
from taskschema_robot.objects.catalogue import get_object
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.safety.limits import SafetyLimits

log = logging.getLogger("taskschema.robot")


@dataclass(frozen=True)
class Serving:
    """What `taskschema-robot run` was asked to do."""

    run: str
    """Name of the run, or its folder on this machine."""
    item: str
    """Name of the object."""
    redis: str | None
    """URL; None: the one embedded in the run's folder."""
    twin: str | None
    """URL of a twin's control server; None: robots."""
    left: str | None
    right: str | None
    """URLs of the robots' rosbridges."""
    folder: Path
    """Of the agent's own log, one folder a run below it."""
    speed_ratio: float
    rate: int
    """Set-points a second."""


def serve(options: Serving, operator: Operator, stop: threading.Event) -> None:
    """Serve until told to stop, or the run is over.

    Raises:
        TaskschemaError: for whatever the user can mend.
    """
    run = Path(options.run).name
    url = options.redis or embedded_redis_url(Path(options.run))
    item, limits = (
        get_object(options.item),
        SafetyLimits(speed_ratio=options.speed_ratio, period=1.0 / options.rate),
    )
    with ExitStack() as stack:
        records = RunRecords(connect(url))
        task = task_of(records.config(run))
        if not isinstance(task, SceneTask) or task.family != item.family:
            raise ConfigError(f"Run {run!r} is about {task.family}, {item.name} is for {item.family}.")
        if options.twin is not None:
            hardware = twin_hardware(stack, options.twin)
        else:
            assert options.left is not None
            assert options.right is not None
            hardware = robot_hardware(stack, options.left, options.right)
        gate = SafetyGate(hardware.drivers, hardware.clock, limits)
        gate.prepare()
        if hardware.twin is None:
            raise ConfigError("Training on states needs a twin: on robots, states are not to be had.")
        world = TrueWorld(hardware.twin, task, item, hardware.clock)
        runner = EpisodeRunner(task, np.array(item.size), gate, world, hardware.clock, limits)
        agent_id = f"robot-{socket.gethostname()}"
        bus = WorkerBus(connect(url), run, agent_id, kind="robot", lease_seconds=LEASE_SECONDS)
        stack.enter_context(bus)
        folder = options.folder / run
        RobotAgent(bus, records, run, task, runner, gate, operator, folder).run(stop)


def embedded_redis_url(folder: Path) -> str:
    """Return the URL of the Redis embedded in a run's folder on this machine.

    Raises:
        ConfigError: if there is none; --redis names another.

    """
    path = folder / "redis" / "redis.conf"
    try:
        text = path.read_text()
    except OSError:
        raise ConfigError(f"{path} cannot be read: name the run's Redis with --redis URL.") from None
    port, password = (re.search(rf"^{word} (\S+)$", text, re.MULTILINE) for word in ("port", "requirepass"))
    if port is None or password is None:
        raise ConfigError(f"{path} names no port and password: name the run's Redis with --redis URL.")
    return f"redis://:{password[1]}@127.0.0.1:{port[1]}"
