"""Simulation with the robot's gate: it refuses what the robot's agent refuses, and nothing moves then."""

import numpy as np
import pytest

from taskschema.config import RunConfig
from taskschema.errors import ConfigError
from taskschema.policies import Policy, PolicySnapshot
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.plan_checks import check_plan
from taskschema.safety.sweep import Sweep
from taskschema.schema import one_hot_logits
from taskschema.tasks import get_task
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_learner.networks.initial_weights import first_weights
from taskschema_robot.agent.skill_step import StepPlanner
from taskschema_robot.drivers.driver import ArmState, GripperState
from taskschema_worker.environments import environment_of
from taskschema_worker.plan_gate import ROBOT_OPENING, SET_POINT_PERIOD, PlanGate
from taskschema_worker.rollout import collect_slots
from taskschema_worker.scene_environment import SceneEnvironment

BAR = LateralLifting()
SPACE = BAR.pairs
CONFIG = RunConfig(task="lateral-lifting", policy="oracle", safety_gate=True)


class SpyingGate(PlanGate):
    """Keeps what it was asked about."""

    def __init__(self, task):
        super().__init__(task)
        self.calls = []

    def refused(self, start, pairs, arguments, paths):
        found = super().refused(start, pairs, arguments, paths)
        self.calls.append((start, pairs, arguments, paths, found))
        return found


def begun(gate=None, count=6, task=BAR):
    environment = SceneEnvironment(task, gate=gate)
    return environment, environment.reset([np.random.default_rng(index) for index in range(count)])


def grasps(observations, apart):
    """The expert's grasps, each arm's moved towards the bar's centre: 1 is the expert's, 0 the centre."""
    arguments = BAR.expert_arguments(observations, 0)
    for arm in (0, 1):
        columns = SPACE.columns(arm, 0)
        arguments[:, columns.start : columns.start + 2] *= apart
    return np.full(len(observations), SPACE.index("top_grasp", "top_grasp")), arguments


def test_a_refused_step_counts_and_nothing_moves():
    environment, observations = begun(PlanGate(BAR))
    episodes = np.arange(6)
    pairs, arguments = grasps(observations, apart=0.1)
    before = environment._simulation.positions.copy(), environment._simulation.velocities.copy()
    result = environment.step(episodes, pairs, arguments)
    assert result.refused.all()
    assert not result.success.any()
    assert (result.physics_steps == 0).all()
    np.testing.assert_array_equal(environment._simulation.positions, before[0])
    np.testing.assert_array_equal(environment._simulation.velocities, before[1])
    step = BAR.observation.get(result.observations, "timestep")
    np.testing.assert_array_equal(step, np.tile([0.0, 1.0, 0.0], (6, 1)))
    rest = np.setdiff1d(np.arange(observations.shape[1]), np.arange(*slice_of("timestep").indices(10**6)))
    np.testing.assert_array_equal(result.observations[:, rest], observations[:, rest])


def slice_of(name):
    return BAR.observation.slices[name]


class OpenGate(PlanGate):
    """Refuses nothing."""

    def refused(self, start, pairs, arguments, paths):
        return np.zeros(len(pairs), dtype=bool)


def test_what_is_let_through_moves_as_if_nothing_else_were_refused():
    gated, observations = begun(PlanGate(BAR))
    free, _ = begun(OpenGate(BAR))
    pairs, arguments = grasps(observations, apart=1.0)
    _, close = grasps(observations, apart=0.1)
    arguments[::2] = close[::2]
    episodes = np.arange(6)
    for step in range(2):
        first, second = (world.step(episodes, pairs, arguments) for world in (gated, free))
        np.testing.assert_array_equal(first.refused, (episodes % 2 == 0) & (step == 0))
        np.testing.assert_array_equal(first.observations[1::2], second.observations[1::2])
        np.testing.assert_array_equal(first.success[1::2], second.success[1::2])
        pairs = np.full(6, SPACE.index("lift", "lift"))
    assert first.success[1::2].all()
    assert not first.success[::2].any()


def test_the_outcome_is_where_the_step_ends():
    """Hands that rise by 28 and 45 cm pass the goal together and leave the bar tilted: a camera sees that."""
    gated, observations = begun(PlanGate(BAR))
    free, _ = begun()
    pairs, arguments = grasps(observations, apart=1.0)
    lift = np.full(6, SPACE.index("lift", "lift"))
    for arm, distance in enumerate((0.28, 0.45)):
        arguments[:, SPACE.columns(arm, 1)] = distance
    episodes = np.arange(6)
    outcomes = []
    for world in (gated, free):
        world.step(episodes, pairs, arguments)
        outcomes.append(world.step(episodes, lift, arguments).success)
    assert not outcomes[0].any()
    assert outcomes[1].all()


def test_hands_open_as_far_as_the_robot_s():
    gated, _ = begun(PlanGate(BAR), count=1)
    free, _ = begun(count=1)
    episode = np.array([0])
    np.testing.assert_allclose(gated._simulation.openings(episode), ROBOT_OPENING, atol=1e-9)
    assert (free._simulation.openings(episode) > 0.078).all()


def state_of(start, row, arm):
    rest = np.zeros(7)
    gripper = GripperState(float(start.opening[row, arm]), True, False, False, False)
    return ArmState(
        0.0,
        0.0,
        start.joints[row, arm],
        rest,
        rest,
        np.zeros(6),
        collision=False,
        enabled=True,
        stopped=False,
        error=False,
        emergency_stop=False,
        gripper=gripper,
    )


@pytest.mark.parametrize(("name", "seed"), [("lateral-lifting", 3), ("opening", 4)])
def test_it_decides_as_the_robot_s_agent_does(name, seed):
    """Random steps, three in a row: the agent's own planner and the gate's own checks say the same."""
    task, count = get_task(name), 12
    gate = SpyingGate(task)
    environment, _ = begun(gate, count, task)
    rng = np.random.default_rng(seed)
    limits = SafetyLimits(period=SET_POINT_PERIOD)
    sweep = Sweep(limits)
    planners = []
    for step in range(3):
        pairs = np.full(count, task.paper_pairs[min(step, 1)])
        arguments = task.pairs.to_si(rng.uniform(-1, 1, (count, task.pairs.argument_count)))
        environment.step(np.arange(count), pairs, arguments)
        start, _, _, paths, found = gate.calls[-1]
        if not planners:
            planners = [StepPlanner(task, size, limits.period, limits.speed_ratio) for size in start.sizes]
        for row, planner in enumerate(planners):
            states = (state_of(start, row, 0), state_of(start, row, 1))
            motion = planner.plan(int(pairs[row]), arguments[row], states, start.poses[row])
            mine = gate.motion(row, start, int(pairs[row]), arguments[row], paths)
            np.testing.assert_allclose(mine.joints, motion.joints, atol=1e-9)
            np.testing.assert_array_equal(mine.opening, motion.opening)
            assert [held is None for held in mine.held] == [held is None for held in motion.held]
            measured = start.joints[row]
            refusal = check_plan(motion, measured, limits, start.set_points[row])
            refusal = refusal or sweep.check(motion, measured)
            assert found[row] == (refusal is not None)
            if refusal is None:
                planner.done(int(pairs[row]), motion)
    every = np.concatenate([call[-1] for call in gate.calls])
    assert 0 < every.sum() < len(every)


def test_episodes_do_not_depend_on_their_batch():
    task = get_task("lateral-lifting")
    logits = one_hot_logits(task.paper_pairs, task.horizon, len(task.pairs))
    policy = Policy(PolicySnapshot(0, first_weights(CONFIG, task), logits), task.pairs, task.observation)

    def collected(slots):
        with_gate = environment_of(CONFIG, task)
        made = collect_slots(
            with_gate, policy, seed=0, round_index=0, slots=slots, episodes_per_slot=4, horizon=3
        )
        with_gate.close()
        return made

    together, alone = collected(range(3)), [collected([slot])[0] for slot in range(3)]
    refused = 0
    for first, second in zip(together, alone, strict=True):
        for one, other in zip(first, second, strict=True):
            np.testing.assert_array_equal(one.observations, other.observations)
            assert (one.refused, one.success, one.physics_steps) == (
                other.refused,
                other.success,
                other.physics_steps,
            )
            refused += one.refused
    assert refused > 0


def test_a_task_without_arms_has_no_gate():
    config = replace_config(task="toy")
    with pytest.raises(ConfigError, match="leave --safety-gate out"):
        environment_of(config, get_task("toy"))


def replace_config(**changes):
    return RunConfig(**{"task": "toy", "policy": "oracle", "safety_gate": True} | changes)
