"""Opening in the simulator: the expert, what one arm can do, and independence of the batch."""

import numpy as np
import pytest

from taskschema.tasks.opening import Opening
from taskschema_worker.scene_environment import SceneEnvironment

TASK = Opening()
SPACE = TASK.pairs


@pytest.fixture(scope="module")
def environment():
    environment = SceneEnvironment(TASK)
    yield environment
    environment.close()


def run(environment, schema, count, start=0):
    """Run the expert under `schema`; return first and last observations and the outcomes."""
    first = observations = environment.reset([np.random.default_rng(start + i) for i in range(count)])
    success = np.zeros(count, dtype=bool)
    for step, pair in enumerate(schema):
        pairs = np.full(count, SPACE.index(*pair))
        result = environment.step(np.arange(count), pairs, TASK.expert_arguments(observations, step))
        observations, success = result.observations, success | result.success
    return first, observations, success


def yaw(observations):
    w, _, _, z = TASK.observation.get(observations, "object.quaternion").T
    return 2 * np.arctan2(z, w)


def test_bottle_stands_still_when_nobody_touches_it(environment):
    first, last, success = run(environment, [("twist", "twist")], 4)
    assert not success.any()
    for name in ("object.position", "object.quaternion", "object.hinge"):
        get = TASK.observation.get
        np.testing.assert_allclose(get(last, name), get(first, name), atol=1e-3)


def test_expert_opens_bottles_of_every_size(environment):
    _, _, success = run(environment, TASK.paper_schema, 16)
    assert success.mean() >= 0.95


def test_either_arm_can_twist_while_the_other_holds(environment):
    mirrored = [(right, left) for left, right in TASK.paper_schema]
    assert run(environment, mirrored, 8)[2].mean() >= 0.9


def test_twisting_without_holding_the_base_turns_the_whole_bottle(environment):
    _, last, success = run(environment, [("top_grasp", "no_op"), ("twist", "no_op")], 8)
    assert not success.any()
    assert (yaw(last) > np.pi / 2).all()
    assert (np.abs(TASK.observation.get(last, "object.hinge")) < 0.2).all()


def test_holding_the_base_alone_turns_nothing(environment):
    _, last, success = run(environment, [("no_op", "side_grasp"), ("no_op", "twist")], 8)
    assert not success.any()
    assert (np.abs(TASK.observation.get(last, "object.hinge")) < 0.2).all()


def test_result_has_the_same_bits_in_any_batch_and_with_any_threads(environment):
    count = 12
    rng = np.random.default_rng(1)
    pairs = rng.integers(0, len(SPACE), (count, 3))
    arguments = SPACE.to_si(rng.uniform(-1, 1, (count, 3, SPACE.argument_count)))

    def episodes(environment, chosen):
        history = [environment.reset([np.random.default_rng(index) for index in chosen])]
        for step in range(3):
            rows = np.arange(len(chosen))
            result = environment.step(rows, pairs[chosen, step], arguments[chosen, step])
            history.append(result.observations)
        return np.stack(history, axis=1)

    everything = episodes(environment, np.arange(count))
    for chosen in (np.array([7]), np.array([2, 11, 5])):
        np.testing.assert_array_equal(episodes(environment, chosen), everything[chosen])
    threaded = SceneEnvironment(TASK, threads=3)
    np.testing.assert_array_equal(episodes(threaded, np.arange(count)), everything)
    threaded.close()


class HeldInPassing(Opening):
    """Its goal holds while something moves, and no longer where the step ends."""

    def goal_reached(self, start, poses):
        return np.full(poses.shape[:2], poses.shape[1] > 1)


@pytest.mark.parametrize("in_passing", [False, True])
def test_a_cap_that_turns_in_passing_while_the_bottle_falls_opens_nothing(monkeypatch, in_passing):
    monkeypatch.setattr(HeldInPassing, "goal_in_passing", in_passing)
    assert not TASK.goal_in_passing
    environment = SceneEnvironment(HeldInPassing())
    _, _, success = run(environment, [("twist", "no_op")], 2)
    environment.close()
    assert success.all() == in_passing


def test_a_search_sees_the_distance_only_where_the_goal_is_tested():
    environment = SceneEnvironment(TASK)
    environment.measure_distance = True
    _, last, success = run(environment, TASK.paper_schema, 4)
    assert success.all()
    assert (environment.closest == 0).all()
    assert (TASK.observation.get(last, "object.hinge") >= TASK.hinge_goal).all()
    environment.close()
