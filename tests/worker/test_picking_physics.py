"""Picking in the simulator: the expert, what one arm can do, friction, and independence of the batch."""

from dataclasses import replace

import numpy as np
import pytest

from taskschema.tasks.picking import BALL_RADIUS, DENSITY, LIFT_GOAL, Picking
from taskschema_worker.audit.search import Search, search_arguments
from taskschema_worker.scene_environment import SceneEnvironment
from taskschema_worker.simulation import Simulation

TASK = Picking()
SPACE = TASK.pairs
GRAVITY = 9.81


@pytest.fixture(scope="module")
def environment():
    environment = SceneEnvironment(TASK)
    yield environment
    environment.close()


def run(environment, schema, count, arguments_of=TASK.expert_arguments):
    """Run `schema` and return the ball's positions [N, steps + 1, 3] and whether each episode succeeded."""
    observations = environment.reset([np.random.default_rng(index) for index in range(count)])
    positions = [TASK.observation.get(observations, "object.position")]
    success = np.zeros(count, dtype=bool)
    for step, pair in enumerate(schema):
        pairs = np.full(count, SPACE.index(*pair))
        result = environment.step(np.arange(count), pairs, arguments_of(observations, step))
        observations, success = result.observations, success | result.success
        positions.append(TASK.observation.get(observations, "object.position"))
    return np.stack(positions, axis=1), success


def test_expert_lifts_the_ball(environment):
    _, success = run(environment, TASK.paper_schema, 24)
    assert success.mean() >= 0.95


def test_ball_nobody_touches_stays_where_it_is(environment):
    positions, _ = run(environment, [("lift", "lift")], 4)
    np.testing.assert_allclose(positions[:, 1], positions[:, 0], atol=1e-3)


@pytest.mark.parametrize("arm", [0, 1])
def test_a_single_gripper_s_grasp_and_lift_drops_the_ball(environment, arm):
    """The fingers come down on the ball's middle, close on its upper side, and it slips out of them."""

    def central(observations, step):
        arguments = TASK.expert_arguments(observations, step)
        arguments[:, SPACE.columns(arm, 0)] = 0.0
        return arguments

    pairs = [(skill, "no_op") if arm == 0 else ("no_op", skill) for skill in ("top_grasp", "lift")]
    positions, success = run(environment, pairs, 12, central)
    assert not success.any()
    np.testing.assert_allclose(positions[:, -1, 2], BALL_RADIUS, atol=5e-3)


@pytest.mark.parametrize("idle", [0, 1])
def test_one_arm_with_the_expert_s_arguments_lifts_nothing(environment, idle):
    schema = [("no_op", right) if idle == 0 else (left, "no_op") for left, right in TASK.paper_schema]
    positions, success = run(environment, schema, 8)
    assert not success.any()
    assert (positions[..., 2] < BALL_RADIUS + 0.5 * LIFT_GOAL).all()


@pytest.mark.parametrize(
    "schema",
    [
        [("top_grasp", "no_op"), ("lift", "no_op")],
        [("no_op", "go_to_pose"), ("no_op", "top_grasp"), ("no_op", "lift")],
        [("go_to_pose", "no_op"), ("go_to_pose", "no_op"), ("lift", "no_op")],
    ],
)
def test_no_arguments_that_a_search_finds_lift_the_ball_with_one_arm(environment, schema):
    environment.measure_distance = True
    found = search_arguments(environment, TASK, tuple(schema), 0, 0, Search(48, 3, 24))
    assert found.training_successes == 0
    assert found.successes == 0


def test_hands_that_no_longer_press_drop_the_ball(environment):
    """A go-to pose that ends before it touches the ball leaves nothing to lift with."""

    def short(observations, step):
        arguments = TASK.expert_arguments(observations, step)
        for arm in (0, 1):
            arguments[:, SPACE.columns(arm, 1).start + 1] = -0.1 if arm == 0 else 0.1
        return arguments

    assert not run(environment, TASK.paper_schema, 8, short)[1].any()


def test_ball_slides_by_the_friction_that_was_drawn():
    """By hand: friction times gravity, also below the pads' and the table's own.

    Less than that by what a ball that begins to roll takes of the friction cone to resist it.
    """
    frictions = np.array([0.05, 0.3, 0.8])
    simulation = Simulation(TASK, threads=1)
    ball = TASK.draw_instance(np.random.default_rng(0))
    simulation.reset([replace(ball, friction=friction) for friction in frictions])
    speed, seconds = 3.0, 0.08  # it would only roll after 0.11 s
    steps = round(seconds / simulation.timestep)
    controls = np.zeros((3, steps, simulation.control_count))
    controls[:, :, simulation.indices.arm_controls] = TASK.home_joints
    simulation.advance(np.arange(3), controls)  # it settles on the table
    simulation.velocities[:, -6] = speed
    simulation.advance(np.arange(3), controls)
    slowed = (speed - simulation.velocities[:, -6]) / seconds
    simulation.close()
    shares = slowed / (frictions * GRAVITY)
    assert (shares > 0.7).all()
    assert (shares < 1.05).all()


def test_ball_has_the_mass_of_its_density():
    simulation = Simulation(TASK, threads=1)
    simulation.reset([TASK.draw_instance(np.random.default_rng(0))])
    model = simulation._models[0]
    mass = model.body_mass[model.body("object").id]
    simulation.close()
    assert mass == pytest.approx(DENSITY * 4 / 3 * np.pi * BALL_RADIUS**3)


def test_result_has_the_same_bits_in_any_batch_and_with_any_threads(environment):
    count = 12
    rng = np.random.default_rng(1)
    pairs = rng.integers(0, len(SPACE), (count, 3))
    pairs[:4] = TASK.paper_pairs
    arguments = SPACE.to_si(rng.uniform(-1, 1, (count, 3, SPACE.argument_count)))

    def episodes(environment, chosen):
        history = [environment.reset([np.random.default_rng(index) for index in chosen])]
        for step in range(3):
            rows = np.arange(len(chosen))
            result = environment.step(rows, pairs[chosen, step], arguments[chosen, step])
            history.append(result.observations)
        return np.stack(history, axis=1)

    everything = episodes(environment, np.arange(count))
    for chosen in (np.array([3]), np.array([2, 11, 5])):
        np.testing.assert_array_equal(episodes(environment, chosen), everything[chosen])
    threaded = SceneEnvironment(TASK, threads=3)
    np.testing.assert_array_equal(episodes(threaded, np.arange(count)), everything)
    threaded.close()
