"""Lateral lifting in the simulator: outcomes, physical honesty, and independence of the batch."""

import numpy as np
import pytest

from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_worker.scene_environment import SceneEnvironment

TASK = LateralLifting()
SPACE = TASK.pairs


def generators(count, start=0):
    return [np.random.default_rng(start + index) for index in range(count)]


@pytest.fixture(scope="module")
def environment():
    environment = SceneEnvironment(TASK, threads=1)
    yield environment
    environment.close()


def run(environment, names, pairs, arguments):
    """Run episodes of three given steps; return stacked observations and outcomes of every step."""
    observations = environment.reset(generators(len(names)) if isinstance(names, range) else names)
    history = [observations]
    success = []
    for step in range(pairs.shape[1]):
        result = environment.step(np.arange(len(pairs)), pairs[:, step], arguments[:, step])
        history.append(result.observations)
        success.append(result.success)
    return np.stack(history, axis=1), np.stack(success, axis=1)


def expert_success(environment, schema, count, arguments_of=TASK.expert_arguments):
    observations = environment.reset(generators(count))
    success = np.zeros(count, dtype=bool)
    for step, pair in enumerate(schema):
        pairs = np.full(count, SPACE.index(*pair))
        result = environment.step(np.arange(count), pairs, arguments_of(observations, step))
        observations, success = result.observations, success | result.success
    return success


def random_steps(count, seed):
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, len(SPACE), (count, 3))
    arguments = SPACE.to_si(rng.uniform(-1, 1, (count, 3, SPACE.argument_count)))
    return pairs, arguments


def test_expert_lifts_the_bar(environment):
    assert expert_success(environment, TASK.paper_schema, 32).mean() >= 0.95


@pytest.mark.parametrize("idle", [0, 1])
def test_one_arm_cannot_lift_the_bar(environment, idle):
    """The other arm grasps the bar at its very centre, where it would balance, and is too weak to lift it."""

    def central_grasp(observations, step):
        arguments = TASK.expert_arguments(observations, step)
        for arm in range(2):
            arguments[:, SPACE.columns(arm, 0).start : SPACE.columns(arm, 0).start + 2] = 0.0
        return arguments

    schema = [("no_op", skill) if idle == 0 else (skill, "no_op") for skill in ("top_grasp", "lift", "lift")]
    assert not expert_success(environment, schema, 16, central_grasp).any()


def test_result_has_the_same_bits_in_any_batch_and_with_any_threads(environment):
    pairs, arguments = random_steps(24, seed=1)
    everything, success = run(environment, range(24), pairs, arguments)
    rng = np.random.default_rng(2)
    for size in (1, 2, 3, 11):
        chosen = rng.choice(24, size, replace=False)
        part = [np.random.default_rng(index) for index in chosen]
        observations, outcome = run(environment, part, pairs[chosen], arguments[chosen])
        np.testing.assert_array_equal(observations, everything[chosen])
        np.testing.assert_array_equal(outcome, success[chosen])
    threaded = SceneEnvironment(TASK, threads=3)
    observations, outcome = run(threaded, range(24), pairs, arguments)
    threaded.close()
    np.testing.assert_array_equal(observations, everything)
    np.testing.assert_array_equal(outcome, success)
