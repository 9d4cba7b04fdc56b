"""Opening without a simulator: objects, goal, observation, expert."""

from pathlib import Path

import numpy as np
import pytest

from taskschema.tasks.opening import BOTTLE_SIZE, Opening
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_observation import observe

TASK = Opening()


def observation(instance, hinge=0.0):
    pose = instance.pose
    pose[7] = hinge
    size = np.array([TASK.object_size]) * instance.scale
    return observe(
        TASK.geometry, TASK.home_joints[None], np.zeros((1, 2, 7)), pose[None], size, np.array([0])
    )


def test_it_is_registered_with_the_paper_s_schema_and_sixteen_pairs():
    task = get_task("opening")
    assert isinstance(task, Opening)
    assert task.paper_schema == (("top_grasp", "side_grasp"), ("twist", "no_op"))
    assert len(task.pairs) == 16
    assert task.pairs.argument_count == 12


def test_location_and_size_vary_over_their_ranges():
    instances = [TASK.draw_instance(np.random.default_rng(seed)) for seed in range(400)]
    for values, (low, high) in (
        ([item.position[0] for item in instances], (-TASK.location_range[0], TASK.location_range[0])),
        ([item.position[1] for item in instances], (-TASK.location_range[1], TASK.location_range[1])),
        ([item.scale for item in instances], TASK.scale_range),
    ):
        width = high - low
        assert low <= min(values) < low + 0.02 * width
        assert high - 0.02 * width < max(values) <= high
    for item in instances:
        assert item.position[2] == pytest.approx(0.5 * BOTTLE_SIZE[2] * item.scale)


def test_corners_are_the_extremes():
    assert len(TASK.corner_names) == 8
    assert TASK.corner_names[0] == "x -0.06 m, y -0.06 m, size 0.9"
    corner = TASK.draw_corner(0, np.random.default_rng(0))
    assert corner.position[0] <= -0.9 * TASK.location_range[0]
    assert corner.position[1] <= -0.9 * TASK.location_range[1]
    assert corner.scale <= 0.91


def test_a_hand_closes_around_every_bottle_s_cap():
    """The top grasp's height is the middle of the cap, whatever the size."""
    assert (0.5 + TASK.top_grasp_height) * BOTTLE_SIZE[2] == pytest.approx(0.16)


@pytest.mark.parametrize(
    ("hinge", "shift", "angle", "axis", "distance"),
    [
        (np.pi / 2 + 1e-6, 0.0, 0.0, 2, 0.0),
        (np.pi / 4, 0.0, 0.0, 2, 0.5),
        (-np.pi / 2, 0.0, 0.0, 2, 2.0),  # the wrong way: to tighten is not to open
        (1.6, 0.049, 0.0, 2, 0.0),
        (1.6, 0.075, 0.0, 2, 0.5),
        (1.6, 0.0, 0.34, 2, 0.0),
        (1.6, 0.0, 0.70, 2, 1.0),
        (1.6, 0.0, -0.70, 0, 1.0),
        (1.6, 0.1, 0.70, 1, 2.0),
    ],
)
def test_goal_is_a_quarter_turn_of_the_hinge_on_a_base_that_keeps_its_pose(
    hinge, shift, angle, axis, distance
):
    start = np.array([[0.01, 0.02, 0.095, 1.0, 0.0, 0.0, 0.0, 0.0]])
    pose = start[:, None].copy()
    pose[0, 0, 0] += shift
    pose[0, 0, 3], pose[0, 0, 4 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    pose[0, 0, 7] = hinge
    assert TASK.goal_distance(start, pose)[0, 0] == pytest.approx(distance, abs=1e-9)
    assert TASK.goal_reached(start, pose)[0, 0] == (distance == 0.0)


def test_hinge_counts_from_where_it_started():
    start = np.array([[0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 1.0]])
    pose = np.repeat(start[:, None], 2, axis=1)
    pose[0, :, 7] = 1.0 + np.pi / 2 + np.array([1e-6, -1e-3])
    np.testing.assert_array_equal(TASK.goal_reached(start, pose), [[True, False]])


def test_observation_shows_size_and_hinge():
    assert TASK.observation.size == 70
    instance = TASK.draw_instance(np.random.default_rng(3))
    row = observation(instance, hinge=0.25)
    np.testing.assert_allclose(
        TASK.observation.get(row, "object.size"), np.array([BOTTLE_SIZE]) * instance.scale
    )
    np.testing.assert_array_equal(TASK.observation.get(row, "object.hinge"), [[0.25]])
    np.testing.assert_array_equal(TASK.observation.get(row, "object.position"), [instance.position])
    assert np.abs(TASK.observation.to_network(row)).max() < 2.0


def test_expert_stays_in_the_search_spaces():
    rows = observation(TASK.draw_instance(np.random.default_rng(1)))
    normalised = TASK.pairs.to_normalised(TASK.expert_arguments(rows, 0))
    assert (np.abs(normalised) <= 1.0).all()


def test_every_field_is_documented():
    page = (Path(__file__).parents[2] / "docs/tasks/opening.md").read_text()
    for field in TASK.observation.fields:
        assert f"| `{field.name}` | {field.size} | {field.unit} | {field.meaning} |" in page
