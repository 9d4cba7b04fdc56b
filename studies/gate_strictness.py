"""Whether the safety gate refuses what works: `python -m studies.gate_strictness lateral-lifting`.

Simulates episodes of the initial policy, or a run's, without a gate, and puts the plans of those that succeed
through the gate's checks before a motion, from the very states that they began in. A plan that is refused
and that led to a success is one that a robot could not have learned from. With `--touching` only contact is
refused: what no clearance has to do with.
"""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.config import RunConfig
from taskschema.policies import ActingPolicy, policy_of
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.plan_checks import check_plan
from taskschema.safety.refusal import Refusal
from taskschema.safety.sweep import Sweep
from taskschema.tasks.registry import task_of
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.task import StepResult
from taskschema_learner.learner import Learner
from taskschema_learner.machine import machine
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import newest_policy
from taskschema_robot.agent.skill_step import StepPlanner
from taskschema_robot.drivers.driver import ArmState, GripperState
from taskschema_worker.rollout import collect_slots
from taskschema_worker.scene_environment import SceneEnvironment

BATCH = 200
TOUCHING = dict.fromkeys(
    ("sweep_resolution", "arm_clearance", "self_clearance", "table_clearance", "finger_clearance"), 0.0005
)
"""Limits that only contact breaks [m]."""


@dataclass(frozen=True, eq=False)
class Begun:
    """A step as it began."""

    pair: int
    arguments: FloatArray
    """[A] SI units."""
    joints: FloatArray
    """[2, 7] measured [rad]."""
    openings: FloatArray
    """[2] measured [m]."""
    pose: FloatArray
    """[7 + h] of the object."""


class NotedEnvironment(SceneEnvironment):
    """Notes how each step began."""

    def reset_to(self, instances: Sequence[ObjectInstance]) -> FloatArray:
        """See `SceneEnvironment`."""
        self.instances = instances
        self.begun: list[list[Begun]] = [[] for _ in instances]
        return super().reset_to(instances)

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        """See `SceneEnvironment`."""
        simulation = self._simulation
        joints, poses = simulation.arm_joints(episodes), simulation.object_poses(episodes)
        openings = simulation.openings(episodes)
        for row, episode in enumerate(episodes):
            self.begun[episode].append(
                Begun(int(pairs[row]), arguments[row], joints[row], openings[row], poses[row])
            )
        return super().step(episodes, pairs, arguments)


class GateTrial:
    """The gate's checks before a motion, on states of a simulation."""

    def __init__(self, task: SceneTask, limits: SafetyLimits) -> None:
        self._task, self._limits = task, limits
        self._sweep = Sweep(limits)

    def refusals(self, steps: list[Begun], scale: float) -> Iterator[Refusal | None]:
        """Yield, step by step, why an episode's plan is refused; None: it is let through."""
        size = scale * np.array(self._task.object_size)
        planner = StepPlanner(self._task, size, self._limits.period, self._limits.speed_ratio)
        held_at = None
        for step in steps:
            states = (_state(step, 0), _state(step, 1))
            motion = planner.plan(step.pair, step.arguments, states, step.pose)
            refusal = check_plan(motion, step.joints, self._limits, held_at)
            yield refusal or self._sweep.check(motion, step.joints)
            planner.done(step.pair, motion)
            held_at = np.asarray(motion.joints[:, -1])


def _state(step: Begun, arm: int) -> ArmState:
    gripper = GripperState(float(step.openings[arm]), True, False, False, False)
    rest = np.zeros(7)
    return ArmState(
        0.0, 0.0, step.joints[arm], rest, rest, np.zeros(6), False, True, False, False, False, gripper
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", nargs="?", help="not needed with --run")
    parser.add_argument("--episodes", type=int, default=4000, help=f"in batches of {BATCH}")
    parser.add_argument("--run", type=Path, help="folder of a run, whose newest policy acts")
    parser.add_argument("--touching", action="store_true", help="allow everything but contact")
    parser.add_argument("--all", action="store_true", help="check failures' plans, too, not successes' only")
    arguments = parser.parse_args()
    if (arguments.task is None) == (arguments.run is None):
        parser.error("name a task, or a run with --run")
    if arguments.run is None:
        config = RunConfig(task=arguments.task, policy="oracle")
        snapshot = Learner(config, task_of(config)).snapshot()
    else:
        folder = RunFolder.open(arguments.run)
        config, snapshot = folder.config, newest_policy(folder)
    task = task_of(config)
    assert isinstance(task, SceneTask)
    policy = policy_of(config, task, snapshot)
    limits = SafetyLimits(period=0.02, **(TOUCHING if arguments.touching else {}))
    trial, environment = GateTrial(task, limits), NotedEnvironment(task)
    episodes, plans, kinds, spoiled = 0, 0, Counter[str](), 0
    first_steps = Counter[str]()
    rounds = -(-arguments.episodes // BATCH)
    for round_index in range(rounds):
        for success, steps, scale in _episodes(environment, policy, task, config, round_index):
            if not (success or arguments.all):
                continue
            found = list(trial.refusals(steps, scale))
            episodes, plans = episodes + 1, plans + len(found)
            refused = [one for one in found if one is not None]
            spoiled += bool(refused)
            first_steps["let through" if found[0] is None else str(found[0].kind)] += 1
            for one in refused:
                kinds[str(one.kind)] += 1
                if not arguments.all:
                    print(f"{one.kind}: {one.reason}, {one.time:.2f} s after its start")
    whose = "episodes" if arguments.all else "successes"
    print(
        f"{machine()}: {rounds * BATCH} episodes of {task.name}; of {episodes} {whose}, {plans} plans, "
        f"{spoiled} have one that is refused: {dict(kinds)}; first steps: {dict(first_steps)}"
    )


def _episodes(
    environment: NotedEnvironment, policy: ActingPolicy, task: SceneTask, config: RunConfig, round_index: int
) -> Iterator[tuple[bool, list[Begun], float]]:
    """Yield the outcome, the steps and the object's scale of each of a batch of episodes."""
    slots = collect_slots(
        environment,
        policy,
        seed=config.seed,
        round_index=round_index,
        slots=range(BATCH // 4),
        episodes_per_slot=4,
        horizon=task.horizon,
    )
    outcomes = [trajectory.success for slot in slots for trajectory in slot]
    scales = [instance.scale for instance in environment.instances]
    yield from zip(outcomes, environment.begun, scales, strict=True)


if __name__ == "__main__":
    main()
