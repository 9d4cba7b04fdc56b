"""Picking without a simulator: objects, goal, observation, expert."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.motion.hand_clearance import PAD_RADIUS
from taskschema.tasks.picking import BALL_RADIUS, FRICTION_RANGE, LOCATION_RANGE, Picking
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_observation import observe

TASK = Picking()


def observation(instance):
    pose, size = instance.pose[None], np.array([TASK.object_size])
    return observe(TASK.geometry, TASK.home_joints[None], np.zeros((1, 2, 7)), pose, size, np.array([0]))


def test_it_is_registered_with_the_paper_s_schema_and_4096_schemas():
    task = get_task("picking")
    assert isinstance(task, Picking)
    assert task.paper_schema == (("top_grasp", "go_to_pose"), ("no_op", "go_to_pose"), ("lift", "lift"))
    assert len(task.pairs) ** task.horizon == 4096
    assert task.pairs.argument_count == 2 * (3 + 6 + 1)


def test_location_and_friction_vary_over_their_ranges():
    instances = [TASK.draw_instance(np.random.default_rng(seed)) for seed in range(400)]
    for values, (low, high) in (
        ([item.position[0] for item in instances], (-LOCATION_RANGE[0], LOCATION_RANGE[0])),
        ([item.position[1] for item in instances], (-LOCATION_RANGE[1], LOCATION_RANGE[1])),
        ([item.friction for item in instances], FRICTION_RANGE),
    ):
        width = high - low
        assert low <= min(values) < low + 0.02 * width
        assert high - 0.02 * width < max(values) <= high
    assert {item.position[2] for item in instances} == {BALL_RADIUS}


def test_corners_are_the_extremes():
    assert len(TASK.corner_names) == 8
    assert TASK.corner_names[0] == "x -0.08 m, y -0.04 m, friction 0.7"
    corner = TASK.draw_corner(0, np.random.default_rng(0))
    assert corner.position[0] <= -0.9 * LOCATION_RANGE[0]
    assert corner.position[1] <= -0.9 * LOCATION_RANGE[1]
    assert corner.friction <= FRICTION_RANGE[0] + 0.1 * (FRICTION_RANGE[1] - FRICTION_RANGE[0])


def test_open_fingers_meet_the_ball_where_it_is_too_flat_to_be_pulled_up():
    """By hand: round pads of 4 mm meet it 33 degrees from its top; there, friction would have to be 1.52."""
    from_top = np.arcsin((0.5 * rethink_gripper().open + PAD_RADIUS) / (BALL_RADIUS + PAD_RADIUS))
    assert np.rad2deg(from_top) == pytest.approx(33.3, abs=0.1)
    assert FRICTION_RANGE[1] < 0.7 / np.tan(from_top)


@pytest.mark.parametrize(("risen", "distance"), [(0.2501, 0.0), (0.125, 0.5), (0.0, 1.0), (-0.1, 1.4)])
def test_goal_is_25_cm_above_the_start(risen, distance):
    start = np.array([[0.01, 0.02, 0.075, 1.0, 0.0, 0.0, 0.0]])
    pose = start[:, None].copy()
    pose[0, 0, 2] += risen
    assert TASK.goal_distance(start, pose)[0, 0] == pytest.approx(distance, abs=1e-9)
    assert TASK.goal_reached(start, pose)[0, 0] == (distance == 0.0)


def test_friction_is_hidden():
    """The paper varies friction without showing it."""
    instance = TASK.draw_instance(np.random.default_rng(3))
    np.testing.assert_array_equal(observation(instance), observation(replace(instance, friction=0.1)))
    assert TASK.observation.size == 69
    assert np.abs(TASK.observation.to_network(observation(instance))).max() < 2.0


def test_expert_stays_in_the_search_spaces():
    rows = observation(TASK.draw_instance(np.random.default_rng(1)))
    for step in range(TASK.horizon):
        normalised = TASK.pairs.to_normalised(TASK.expert_arguments(rows, step))
        assert (np.abs(normalised) <= 1.0).all()


def test_every_field_is_documented():
    page = (Path(__file__).parents[2] / "docs/tasks/picking.md").read_text()
    for field in TASK.observation.fields:
        assert f"| `{field.name}` | {field.size} | {field.unit} | {field.meaning} |" in page
