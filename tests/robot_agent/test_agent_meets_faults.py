"""The agent meets every fault in the middle of an episode, on the twin, over real sockets, with a real Redis.

Both arms are stopped, nothing is sent until a person acknowledges, the slot is delivered once, and the next
round is run.
"""

import numpy as np
import pytest
from agent_setup import AgentBench, NotedOperator, open_round
from bus_setup import Run, gather
from scripted_expert import TASK, Expert
from twin_setup import LockStep

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import NetworkConfig, RunConfig
from taskschema.safety.limits import SafetyLimits
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.robot_agent import LEASE_SECONDS, RobotAgent
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.objects.catalogue import HEAVY_BAR
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.safety.monitors import CameraMonitor
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

    def __init__(self, run: Run, folder, kind: FaultKind) -> None:
        self.run, self.kind = run, kind
        self.twin = LockStep(HEAVY_BAR)
        client, clock = self.twin.client, self.twin.clock
        self.commands: list[object] = []
        for robot in self.twin.running.twin.robots:
            robot.bridge.graph.topics[JOINT_COMMAND].nodes.append(self.commands.append)
        limits = SafetyLimits(period=0.02, recovery_speed_ratio=0.4)
        camera = CameraMonitor(LockStepCamera(client, clock), limits.camera_age)
        gate = SafetyGate(self.twin.arms, clock, limits, [camera])
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
