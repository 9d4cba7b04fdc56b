"""The composition root of the agent: connects arms, gate, eyes, person and run, and serves to its end."""

import logging
import os
import re
import socket
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import RunConfig
from taskschema.errors import ConfigError
from taskschema.logs import FORMAT_VARIABLE, TextLines, bind, handler, log_format
from taskschema.safety.limits import SafetyLimits
from taskschema.tasks.registry import task_of
from taskschema.tasks.scene_task import SceneTask
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.fault_record import FaultRecord
from taskschema_robot.agent.folder_lock import only_agent_of
from taskschema_robot.agent.refusal_pictures import RefusalPictures
from taskschema_robot.agent.robot_agent import LEASE_SECONDS, RobotAgent
from taskschema_robot.agent.step_log import StepLog
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.agent.world import World
from taskschema_robot.cli.arms import Hardware, Robots, distant_twin, own_twin, robot_hardware, twin_hardware
from taskschema_robot.cli.eyes import Eyes, frame_observer, open_eyes
from taskschema_robot.cli.person import Person, person_at_terminal, unattended_person
from taskschema_robot.cli.stops import let_stop
from taskschema_robot.drivers.driver import ArmDriver
from taskschema_robot.drivers.recorded_arm import RecordedArm
from taskschema_robot.objects.catalogue import get_object
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.camera_world import CameraWorld
from taskschema_robot.reward.following import FollowingMonitor, FollowingThread
from taskschema_robot.reward.tracker import ObjectTracker
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.safety.monitors import CameraMonitor, LinkMonitor
from taskschema_robot.safety.watchdog import Monitor
from taskschema_robot.twin.lock_step import LockStepClock

OWN_TWIN = "own"
"""In place of a twin's address: one in this process."""
FAST_SPARE_SECONDS = 10.0
"""Between two pictures of refused plans where a twin in lock-step would wait for them [s]."""
LINK_PATIENCE = 1.0
"""How long the watchdog's own connection to Redis tries again [s]."""


@dataclass(frozen=True)
class Serving:
    """What `taskschema-robot run` was asked to do; see its options."""

    run: str
    item: str
    redis: str | None
    twin: str | None
    robots: Robots | None
    camera: str | None
    lens: Path | None
    see_truth: bool
    folder: Path
    speed_ratio: float
    rate: int
    stop_port: int
    hold_to_run: bool
    preview: bool
    unattended: bool
    state_from_markers: bool = False


def serve(options: Serving, stop: threading.Event) -> None:
    """Serve until told to stop, or the run is over.

    Raises:
        TaskschemaError: for whatever the user can mend.
    """
    run = Path(options.run).name
    url = options.redis or embedded_redis_url(Path(options.run))
    item, folder = get_object(options.item), options.folder / run
    limits = SafetyLimits(speed_ratio=options.speed_ratio, period=1.0 / options.rate)
    _log_to(folder, run)
    with ExitStack() as stack:
        stack.enter_context(only_agent_of(folder))
        records = RunRecords(connect(url))
        config = records.config(run)
        task = task_of(config)
        if not isinstance(task, SceneTask) or task.family != item.family:
            raise ConfigError(f"Run {run!r} is about {task.family}, {item.name} is for {item.family}.")
        _refuse_states(config, options)
        hardware = _hardware(stack, options, item, limits.period)
        link = LinkMonitor(RunRecords(connect(url, patience=LINK_PATIENCE)), run, limits.link_age)
        monitors: list[Monitor] = [stack.enter_context(link)]
        person = (
            unattended_person()
            if options.unattended
            else person_at_terminal(folder, stop, hold_to_run=options.hold_to_run, preview=options.preview)
        )
        monitors += person.monitors
        sees_images = config.observation == "image"
        eyes = None
        if sees_images or not options.see_truth:
            eyes = open_eyes(stack, hardware, options.camera, options.lens)
            monitors.append(CameraMonitor(eyes.camera, limits.camera_age))
        world = _world(options, hardware, task, item, person, eyes)
        if isinstance(world, CameraWorld) and item.joint_markers:
            monitors += _following(stack, world, hardware)
        gate = _gate(hardware, limits, monitors, folder)
        let_stop(stack, person, gate.stop, None if options.unattended else options.stop_port)
        gate.prepare()
        size, release = np.array(item.size), person.operator.release
        spare = FAST_SPARE_SECONDS if isinstance(hardware.clock, LockStepClock) else 0.0
        observer = frame_observer(task, size, eyes, hardware.clock) if eyes and sees_images else None
        runner = EpisodeRunner(
            task,
            size,
            person.attend(gate),
            world,
            hardware.clock,
            limits,
            person.preview,
            release,
            observer,
            [StepLog(folder / "steps.jsonl"), RefusalPictures(folder / "refusals", spare)],
        )
        agent_id = f"robot-{socket.gethostname()}"
        bus = WorkerBus(connect(url), run, agent_id, kind="robot", lease_seconds=LEASE_SECONDS)
        stack.enter_context(bus)
        RobotAgent(bus, records, run, task, runner, gate, person.operator, folder).run(stop)


def _refuse_states(config: RunConfig, options: Serving) -> None:
    """Raise ConfigError if a policy would see the markers of a real table without anybody having said so."""
    if config.observation == "state" and options.twin is None and not options.state_from_markers:
        raise ConfigError(
            f"Run {options.run!r} is on states, which real robots take from markers: train one with "
            "`--observation image`, whose policy sees pictures only, or say --state-from-markers."
        )


def _hardware(stack: ExitStack, options: Serving, item: RobotObject, period: float) -> Hardware:
    if options.twin is not None:
        own = options.twin == OWN_TWIN
        twin = own_twin(stack, item) if own else distant_twin(stack, options.twin)
        return twin_hardware(stack, twin, period)
    if options.robots is None:
        raise ConfigError("Name both robots: --left URL and --right URL.")
    return robot_hardware(stack, options.robots)


def _gate(hardware: Hardware, limits: SafetyLimits, monitors: Sequence[Monitor], folder: Path) -> SafetyGate:
    """Return the gate, which keeps what was before a fault."""
    left, right = (RecordedArm(driver) for driver in hardware.drivers)
    faults = FaultRecord(folder / "faults", (left.last_seconds, right.last_seconds))
    arms = cast("tuple[ArmDriver, ArmDriver]", (left, right))
    return SafetyGate(arms, hardware.clock, limits, monitors, faults)


def _following(stack: ExitStack, world: CameraWorld, hardware: Hardware) -> list[Monitor]:
    """Have a hinge followed during motions: by a thread, or a monitor where time stands still meanwhile."""
    if isinstance(hardware.clock, LockStepClock):
        return [FollowingMonitor(world.follow)]
    stack.enter_context(FollowingThread(world.follow))
    return []


def _world(
    options: Serving,
    hardware: Hardware,
    task: SceneTask,
    item: RobotObject,
    person: Person,
    eyes: Eyes | None,
) -> World:
    """Return what sees the object."""
    if options.see_truth:
        if hardware.twin is None:
            raise ConfigError("Only a twin tells the truth: leave --see truth out.")
        return TrueWorld(hardware.twin, task, item, hardware.clock)
    assert eyes is not None
    tracker = ObjectTracker(item, eyes.intrinsics)
    evidence = options.folder / Path(options.run).name / "evidence"
    resets = person.resets(hardware.twin)
    return CameraWorld(eyes.camera, tracker, task, item, resets, hardware.clock, evidence)


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


def _log_to(folder: Path, run: str) -> None:
    """Write everything that the agent's parts have to say to `agent.log` in its folder.

    With `TASKSCHEMA_LOG_FORMAT=json` it goes to standard error, too, a JSON object a line.
    """
    kind = log_format(os.environ.get(FORMAT_VARIABLE, "text"))
    folder.mkdir(parents=True, exist_ok=True)
    file = logging.FileHandler(folder / "agent.log")
    file.setFormatter(TextLines())
    bind(run=run)
    logging.basicConfig(level=logging.INFO, handlers=[file, handler(kind)] if kind == "json" else [file])
    logging.getLogger("websockets").setLevel(logging.WARNING)
