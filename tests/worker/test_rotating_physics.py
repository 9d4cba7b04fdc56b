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


def test_turning_without_holding_the_base_turns_the_whole_corkscrew_and_leaves_the_hinge(
    environment, monkeypatch
):
    turned, hinge = np.zeros(8), np.zeros(8)
    advance = environment._simulation.advance

    def recorded(episodes, controls):
        result = advance(episodes, controls)
        w, z, angle = result.object_poses[:, :, 3], result.object_poses[:, :, 6], result.object_poses[:, :, 7]
        turned[episodes] = np.maximum(turned[episodes], (2 * np.arctan2(z, w)).max(axis=1))
        hinge[episodes] = np.maximum(hinge[episodes], np.abs(angle).max(axis=1))
        return result

    monkeypatch.setattr(environment._simulation, "advance", recorded)
    schema = [("go_to_pose", "no_op"), ("go_to_pose", "no_op"), ("rotate", "no_op")]
    assert not run(environment, schema, 8)[1].any()
    assert (hinge < 0.1).all()
    # It turns with the handle until its far side swings out of the hand's way, and slides.
    assert (turned > 0.5).all()


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
