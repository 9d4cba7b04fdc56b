"""Rotating in the simulator: the expert, and what one arm can do."""

import numpy as np
import pytest

from taskschema.tasks.rotating import Rotating
from taskschema_worker.scene_environment import SceneEnvironment

TASK = Rotating()
SPACE = TASK.pairs


@pytest.fixture(scope="module")
def environment():
    environment = SceneEnvironment(TASK)
    yield environment
    environment.close()


def run(environment, schema, count):
    """Run the expert under `schema`; return last observations and the outcomes."""
    observations = environment.reset([np.random.default_rng(index) for index in range(count)])
    success = np.zeros(count, dtype=bool)
    for step, pair in enumerate(schema):
        pairs = np.full(count, SPACE.index(*pair))
        result = environment.step(np.arange(count), pairs, TASK.expert_arguments(observations, step))
        observations, success = result.observations, success | result.success
    return observations, success


def test_expert_turns_corkscrews_of_every_size(environment):
    assert run(environment, TASK.paper_schema, 16)[1].mean() >= 0.95


def test_either_arm_can_turn_while_the_other_holds(environment):
    mirrored = [(right, left) for left, right in TASK.paper_schema]
    assert run(environment, mirrored, 8)[1].mean() >= 0.9


def test_turning_without_holding_the_base_moves_the_whole_corkscrew(environment):
    schema = [("go_to_pose", "no_op"), ("go_to_pose", "no_op"), ("rotate", "no_op")]
    last, success = run(environment, schema, 8)
    assert not success.any()
    assert (np.abs(TASK.observation.get(last, "object.hinge")) < 0.5).all()
    w, _, _, z = TASK.observation.get(last, "object.quaternion").T
    assert (np.abs(2 * np.arctan2(z, w)) > 1.0).mean() >= 0.75


def test_holding_the_base_alone_turns_nothing(environment):
    schema = [("no_op", "side_grasp"), ("no_op", "go_to_pose"), ("no_op", "rotate")]
    assert not run(environment, schema, 8)[1].any()


def test_result_has_the_same_bits_in_any_batch(environment):
    rng = np.random.default_rng(1)
    pairs = rng.integers(0, len(SPACE), (8, 3))
    arguments = SPACE.to_si(rng.uniform(-1, 1, (8, 3, SPACE.argument_count)))

    def episodes(chosen):
        history = [environment.reset([np.random.default_rng(index) for index in chosen])]
        for step in range(3):
            rows = np.arange(len(chosen))
            history.append(environment.step(rows, pairs[chosen, step], arguments[chosen, step]).observations)
        return np.stack(history, axis=1)

    everything = episodes(np.arange(8))
    for chosen in (np.array([6]), np.array([1, 4, 2])):
        np.testing.assert_array_equal(episodes(chosen), everything[chosen])
