"""The agent meets every fault in the middle of an episode, on the twin, over real sockets, with a real Redis.

Both arms are stopped, nothing is sent until a person acknowledges, the slot is delivered once, and the next
round is run.
"""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from agent_setup import AgentBench, NotedOperator, open_round
from bus_setup import Run, gather, wait_until
from scripted_expert import TASK, Expert
from twin_setup import LockStep

from taskschema.bus.connection import connect
from taskschema.bus.learner_life import LearnerLife
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import NetworkConfig, RunConfig
from taskschema.safety.limits import SafetyLimits
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.robot_agent import LEASE_SECONDS, RobotAgent
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.objects.catalogue import HEAVY_BAR
from taskschema_robot.safety import monitors
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.safety.monitors import CameraMonitor, LinkMonitor
from taskschema_robot.sawyer_interface import JOINT_COMMAND
from taskschema_robot.twin.camera import LockStepCamera
from taskschema_robot.twin.faults import FaultKind

CONFIG = RunConfig(
    task="lateral-lifting", slots=1, episodes_per_slot=1, network=NetworkConfig(hidden=(8,)), seed=4
)
MIDDLE = 0.5
"""After the beginning of the episode's first motion [s]."""
FAULTS = {
    FaultKind.DROP_CONNECTION: "connection",
    FaultKind.STALL_CONNECTION: "state_age",
    FaultKind.FREEZE_STATE: "state_age",
    FaultKind.SILENCE_WRENCH: "state_age",
    FaultKind.SILENCE_COLLISION: "state_age",
    FaultKind.LOSE_ACKNOWLEDGEMENT: "gripper",
    FaultKind.PRESS_EMERGENCY_STOP: "emergency_stop",
    FaultKind.STICK_GRIPPER: "gripper",
    FaultKind.JOINT_ERROR: "robot_error",
    FaultKind.FREEZE_CAMERA: "camera",
    FaultKind.REPEAT_PICTURE: "camera",
    FaultKind.OBSTACLE: "collision",
}
"""All but the skewed clock, which stops nothing; what the agent makes of each."""
OF_BOTH = (FaultKind.FREEZE_CAMERA, FaultKind.REPEAT_PICTURE, FaultKind.OBSTACLE)


class ExpertRunner(EpisodeRunner):
    """Episodes of the scripted expert: a network that has learned nothing seldom moves."""

    def run(self, key, policy):
        return super().run(key, Expert(0.35))


class FaultOperator(NotedOperator):
    """Takes the fault back, sees that the arms are stopped and nothing is sent, and acknowledges."""

    def __init__(self, bench: "FaultyAgent") -> None:
        super().__init__()
        self._bench = bench

    def acknowledge(self, fault):
        bench = self._bench
        bench.take_back()
        assert all(arm.state().stopped for arm in bench.twin.arms if arm.connected)
        before = len(bench.commands)
        bench.twin.sleep(0.5)
        assert len(bench.commands) == before, "a set-point before the acknowledgement"
        return super().acknowledge(fault)


class FaultyAgent(AgentBench):
    """An agent on a twin in lock-step; a fault comes in its first episode."""

    def __init__(self, run: Run, folder, kind: FaultKind | None, beside=()) -> None:
        self.run, self.kind = run, kind
        self.twin = LockStep(HEAVY_BAR)
        client, clock = self.twin.client, self.twin.clock
        self.commands: list[object] = []
        for robot in self.twin.running.twin.robots:
            robot.bridge.graph.topics[JOINT_COMMAND].nodes.append(self.commands.append)
        limits = SafetyLimits(period=0.02, recovery_speed_ratio=0.4)
        camera = CameraMonitor(LockStepCamera(client, clock), limits.camera_age)
        gate = SafetyGate(self.twin.arms, clock, limits, [camera, *beside])
        gate.prepare()
        self.operator = FaultOperator(self)
        world = TrueWorld(client, TASK, HEAVY_BAR, clock)
        runner = ExpertRunner(TASK, np.array(HEAVY_BAR.size), gate, world, clock, limits)
        self.bus = WorkerBus(connect(run.url), run.name, "robot", kind="robot", lease_seconds=LEASE_SECONDS)
        records = RunRecords(connect(run.url))
        self.agent = RobotAgent(self.bus, records, run.name, TASK, runner, gate, self.operator, folder)
        self._inject_in_the_middle(world)

    def _inject_in_the_middle(self, world) -> None:
        clock, sleep, reset = self.twin.clock, self.twin.clock.sleep_until, world.reset
        due: list[float] = []

        def begin(instance):
            world.reset = reset
            pose = reset(instance)
            due.append(clock.now() + MIDDLE)
            return pose

        def sleep_until(moment: float) -> None:
            sleep(moment)
            if due and clock.now() > due[0]:
                due.clear()
                self._inject(active=True)

        world.reset, clock.sleep_until = begin, sleep_until

    def _inject(self, *, active: bool) -> None:
        arm = None if self.kind in OF_BOTH else 1
        self.twin.client.inject(self.kind, arm, active=active)

    def take_back(self) -> None:
        self._inject(active=False)
        self.twin.sleep(0.5)

    def leave(self) -> None:
        super().leave()
        self.twin.close()


@pytest.mark.slow
@pytest.mark.parametrize("kind", FAULTS)
def test_nothing_is_lost_and_training_goes_on(shared_redis, tmp_path, kind):
    with Run(shared_redis.url, CONFIG) as run:
        learner, snapshot = open_round(run)
        bench = FaultyAgent(run, tmp_path, kind)
        try:
            bench.serve(1)
            (first,) = gather(learner, 1)
            assert [fault.kind for fault in bench.operator.acknowledged] == [FAULTS[kind]]
            assert len(bench.operator.drops) == 1
            assert first.trajectories[0].attempt == 1
            assert first.trajectories[0].success
            learner.open_round(1, snapshot, range(CONFIG.slots))
            bench.serve(2)
            (second,) = gather(learner, 1)
        finally:
            bench.leave()
        assert (second.trajectories[0].round, second.trajectories[0].attempt) == (1, 0)
        assert run.client.xlen(run.keys.trajectories) == 2
        assert not run.open_slots()
        assert bench.agent.progress.episodes == 2


LEARNER = """
import sys
from taskschema.bus.connection import connect
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.learner_life import LearnerLife
from taskschema.bus.records import RunRecords
from taskschema.tasks.registry import task_of
from taskschema_learner.learner import Learner

client = connect(sys.argv[1])
config = RunRecords(client).config(sys.argv[2])
bus = LearnerBus(client, sys.argv[2], config)
bus.acquire()
bus.open_round(0, Learner(config, task_of(config)).snapshot(), range(config.slots))
bus.set_state("running")
with LearnerLife(bus):
    print("alive", flush=True)
    while True:
        for result in bus.results(0.5):
            first = result.trajectories[0]
            print(result.slot, first.attempt, first.success, flush=True)
"""
"""A learner that opens its round and waits for it: a process that can be killed, and resumed."""


class KillableRedis(EmbeddedRedis):
    """A server that stays dead until it is started again."""

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)
        self._process.wait()

    def start_again(self) -> None:
        self._start()

    def _supervise(self) -> None:
        pass


class KillableLearner:
    """A learner's process."""

    def __init__(self, run: Run) -> None:
        self._command = [sys.executable, "-c", LEARNER, run.url, run.name]
        self.start_again()

    def start_again(self) -> None:
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout.readline() == "alive\n"

    def received(self) -> str:
        """Return what the newest process has received: slot, attempt and success of each."""
        first = self._process.stdout.readline()
        return first + self.kill()

    def kill(self) -> str:
        if self._process.stdout.closed:
            return ""
        self._process.kill()
        return self._process.communicate()[0]


class BereftAgent(FaultyAgent):
    """An agent whose Redis or learner is killed in a motion, and is back after the first way home only."""

    def __init__(self, run: Run, folder, service, link: LinkMonitor) -> None:
        super().__init__(run, folder, None, [link])
        self._service, self._link = service, link
        self.moved = 0

    def _inject(self, *, active: bool) -> None:
        if active:
            self.moved = len(self.commands)
            self._service.kill()
            wait_until(lambda: self._link.fault(0.0) is not None)
        elif self.operator.acknowledged:
            joints = np.stack([arm.state().positions for arm in self.twin.arms])
            np.testing.assert_allclose(joints, TASK.home_joints, atol=0.05)
            self._service.start_again()
            wait_until(lambda: self._link.fault(0.0) is None)


@pytest.fixture
def killable(tmp_path, monkeypatch):
    """A run on a Redis of its own, and what watches the link to it."""
    monkeypatch.setattr(monitors, "LOOK_SECONDS", 0.2)
    with KillableRedis(tmp_path / "redis") as server, Run(server.url, CONFIG) as run:
        link = LinkMonitor(RunRecords(connect(run.url, patience=0.0)), run.name, 6.0)
        yield server, run, link


def serve_one(run: Run, folder, service, link: LinkMonitor) -> None:
    """Serve the run's slot, with the service killed in the first motion."""
    with link:
        bench = BereftAgent(run, folder, service, link)
        try:
            bench.serve(1, seconds=200.0)
        finally:
            bench.leave()
    assert bench.moved > 0, "it was killed before anything moved"
    assert [fault.kind for fault in bench.operator.acknowledged] == ["link", "link"]
    assert run.client.xlen(run.keys.trajectories) == 1


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_redis_is_killed_in_a_motion(tmp_path, killable):
    """The arms go home without it, move no further until it is back, and the slot is delivered once."""
    server, run, link = killable
    learner, _ = open_round(run)
    learner.set_state("running")
    with LearnerLife(learner):
        serve_one(run, tmp_path / "agent", server, link)
        (result,) = gather(learner, 1)
    assert (result.slot, result.trajectories[0].attempt) == (0, 2)
    assert result.trajectories[0].success
    assert not learner.results(1.0)
    assert not run.open_slots()


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_learner_is_killed_in_a_motion(tmp_path, killable):
    """The same; the learner that is started again receives the slot, once."""
    _, run, link = killable
    learner = KillableLearner(run)
    try:
        serve_one(run, tmp_path / "agent", learner, link)
        assert learner.received() == "0 2 True\n"
    finally:
        learner.kill()
    assert not run.open_slots()
