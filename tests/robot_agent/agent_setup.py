"""An agent on recording arms, a scripted object, and a real run on a real Redis."""

import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import redis
from bus_setup import Run
from recording_arms import TestBench

from taskschema.bus.connection import connect
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import NetworkConfig, RunConfig
from taskschema.policies import PolicySnapshot
from taskschema.safety.limits import SafetyLimits
from taskschema.tasks import get_task
from taskschema_learner.learner import Learner
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.operator import Unattended
from taskschema_robot.agent.robot_agent import LEASE_SECONDS, RobotAgent
from taskschema_robot.agent.start_pose import start_pose
from taskschema_robot.objects.catalogue import HEAVY_BAR
from taskschema_robot.reward.judge import Judgement, Outcome

TASK = get_task("lateral-lifting")
CONFIG = RunConfig(
    task="lateral-lifting", slots=3, episodes_per_slot=1, network=NetworkConfig(hidden=(8,)), seed=4
)


class ScriptedWorld:
    """An object that stays where it is; outcomes come from a list, then failure for ever.

    So do last looks, for what stands on the table has failed; a person who is asked knows what is listed.
    """

    def __init__(
        self, outcomes: Sequence[Outcome] = (), looks: Sequence[Outcome] = (), answers: Sequence[Outcome] = ()
    ) -> None:
        self.outcomes, self.looks, self.answers = list(outcomes), list(looks), list(answers)
        self.resets = self.last_looks = self.asked = 0
        self.on_reset = self.on_ask = lambda: None

    def reset(self, instance):
        self.resets += 1
        self.on_reset()
        self.pose = start_pose(HEAVY_BAR, instance)
        return self.pose

    def object_pose(self):
        return self.pose

    def judge(self, start, name):
        outcome = self.outcomes.pop(0) if self.outcomes else Outcome.FAILURE
        return Judgement(outcome, "as scripted", picture=f"{name}.png")

    def ask(self, judgement):
        self.asked += 1
        self.on_ask()
        return Judgement(self.answers.pop(0), "by a person's word") if self.answers else judgement

    def last_look(self, start, name):
        self.last_looks += 1
        outcome = self.looks.pop(0) if self.looks else Outcome.FAILURE
        return Judgement(outcome, "it stands on the table")


class NotedOperator(Unattended):
    """Lets everything stand, and notes what it was told."""

    def __init__(self) -> None:
        self.drops: list[str] = []
        self.acknowledged: list[object] = []

    def acknowledge(self, fault):
        self.acknowledged.append(fault)
        return "tester"

    def dropped(self, reason):
        self.drops.append(reason)


class AgentBench:
    """One agent; `serve` runs it until so many results are in the run's stream."""

    def __init__(self, run: Run, folder: Path, world: ScriptedWorld | None = None) -> None:
        self.run = run
        self.arms = TestBench(TASK.home_joints, SafetyLimits(period=0.02))
        self.world = world or ScriptedWorld()
        self.operator = NotedOperator()
        self.bus = WorkerBus(connect(run.url), run.name, "robot", kind="robot", lease_seconds=LEASE_SECONDS)
        runner = EpisodeRunner(
            TASK, np.array(HEAVY_BAR.size), self.arms.gate, self.world, self.arms.clock, self.arms.limits
        )
        self.agent = RobotAgent(
            self.bus,
            RunRecords(connect(run.url)),
            run.name,
            TASK,
            runner,
            self.arms.gate,
            self.operator,
            folder,
        )

    def serve(self, results: int, seconds: float = 60.0) -> None:
        """Run the agent in this thread until `results` slots are delivered in all."""
        stop, records = threading.Event(), connect(self.run.url)  # before a test may kill that Redis

        def watch() -> None:
            deadline = seconds
            while deadline > 0 and _delivered(records, self.run) < results:
                if stop.wait(0.05):
                    return
                deadline -= 0.05
            stop.set()

        watcher = threading.Thread(target=watch, daemon=True)
        watcher.start()
        try:
            self.agent.run(stop)
        finally:
            stop.set()
            watcher.join()

    def leave(self) -> None:
        self.bus.leave()


def _delivered(records: redis.Redis, run: Run) -> int:
    """Return how many slots are in a run's stream; none as long as its Redis is away."""
    try:
        return int(records.xlen(run.keys.trajectories))
    except (redis.ConnectionError, redis.TimeoutError):
        return 0


def open_round(run: Run, round_index: int = 0) -> tuple[LearnerBus, PolicySnapshot]:
    learner = Learner(run.config, TASK)
    snapshot = learner.snapshot()
    bus = run.learner()
    bus.open_round(round_index, snapshot, range(run.config.slots))
    return bus, snapshot
