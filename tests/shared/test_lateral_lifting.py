from pathlib import Path

import numpy as np
import pytest

from taskschema.tasks.lateral_lifting import (
    BAR_SIZE,
    DENSITY_RANGE,
    LOCATION_RANGE,
    ORIENTATION_TOLERANCE,
    LateralLifting,
)
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_observation import observe

TASK = LateralLifting()


def observation(instance, step=0):
    return observe(
        TASK.geometry,
        TASK.home_joints[None],
        np.zeros((1, 2, 7)),
        instance.pose[None],
        np.array([TASK.object_size]) * instance.scale,
        np.array([step]),
    )


def test_it_is_registered_with_the_paper_s_schema_and_nine_pairs():
    task = get_task("lateral-lifting")
    assert isinstance(task, LateralLifting)
    assert task.paper_schema == (("top_grasp", "top_grasp"), ("lift", "lift"))
    assert len(task.pairs) == 9
    assert task.pairs.argument_count == 8
    assert task.horizon == 3


def test_location_and_density_vary_over_their_ranges():
    instances = [TASK.draw_instance(np.random.default_rng(seed)) for seed in range(400)]
    for values, (low, high) in (
        ([item.position[0] for item in instances], (-LOCATION_RANGE[0], LOCATION_RANGE[0])),
        ([item.position[1] for item in instances], (-LOCATION_RANGE[1], LOCATION_RANGE[1])),
        ([item.density for item in instances], DENSITY_RANGE),
    ):
        width = high - low
        assert low <= min(values) < low + 0.02 * width
        assert high - 0.02 * width < max(values) <= high
    assert {item.position[2] for item in instances} == {BAR_SIZE[2] / 2}


def test_corners_are_the_extremes():
    assert len(TASK.corner_names) == 8
    corner = TASK.draw_corner(0, np.random.default_rng(0))
    assert corner.position[0] <= -0.9 * LOCATION_RANGE[0]
    assert corner.position[1] <= -0.9 * LOCATION_RANGE[1]
    assert corner.density <= DENSITY_RANGE[0] + 0.05 * (DENSITY_RANGE[1] - DENSITY_RANGE[0]) + 1e-9


@pytest.mark.parametrize(
    ("rise", "angle", "axis", "reached"),
    [
        (0.2501, 0.0, 2, True),
        (0.2499, 0.0, 2, False),
        (0.3, 0.99 * ORIENTATION_TOLERANCE, 0, True),
        (0.3, 1.01 * ORIENTATION_TOLERANCE, 0, False),
        (0.3, 1.01 * ORIENTATION_TOLERANCE, 1, False),
        (0.3, -1.01 * ORIENTATION_TOLERANCE, 2, False),
    ],
)
def test_goal_is_height_with_orientation_kept_about_every_axis(rise, angle, axis, reached):
    start = np.array([[0.01, 0.02, 0.03, 1.0, 0.0, 0.0, 0.0]])
    pose = start[:, None].copy()
    pose[0, 0, 2] += rise
    pose[0, 0, 3], pose[0, 0, 4 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    assert TASK.goal_reached(start, pose)[0, 0] == reached
    assert (TASK.goal_distance(start, pose)[0, 0] == 0.0) == reached
    assert TASK.goal_reached(start, -pose * [-1, -1, -1, 1, 1, 1, 1])[0, 0] == reached


def test_observation_is_the_paper_s_list_without_density():
    names = [field.name for field in TASK.observation.fields]
    per_arm = ("joint_positions", "joint_velocities", "end_effector_position", "end_effector_quaternion")
    assert names == [
        *(f"left.{name}" for name in per_arm),
        *(f"right.{name}" for name in per_arm),
        "timestep",
        "object.size",
        "object.position",
        "object.quaternion",
        "object.position_in_left_hand",
        "object.quaternion_in_left_hand",
        "object.position_in_right_hand",
        "object.quaternion_in_right_hand",
    ]
    assert TASK.observation.size == 69
    light, heavy = (TASK.draw_corner(corner, np.random.default_rng(0)) for corner in (0, 1))
    assert light.density < heavy.density
    np.testing.assert_array_equal(observation(light), observation(heavy))


def test_observation_by_hand():
    """Hands at home: 0.2 m to their own sides, 0.14 m up, pointing down."""
    instance = TASK.draw_instance(np.random.default_rng(0))
    row = observation(instance, step=1)
    get = TASK.observation.get
    np.testing.assert_allclose(get(row, "left.end_effector_position"), [[0, -0.2, 0.14]], atol=1e-3)
    np.testing.assert_array_equal(get(row, "timestep"), [[0, 1, 0]])
    np.testing.assert_array_equal(get(row, "object.size"), [BAR_SIZE])
    np.testing.assert_array_equal(get(row, "object.position"), [instance.position])
    # The left hand points down with its x axis along the world's: its z axis is the world's, upside down.
    x, y, z = np.array(instance.position) - [0, -0.2, 0.14]
    np.testing.assert_allclose(get(row, "object.position_in_left_hand"), [[x, -y, -z]], atol=2e-3)


def test_networks_see_numbers_of_about_one():
    rows = np.concatenate(
        [observation(TASK.draw_instance(np.random.default_rng(seed))) for seed in range(50)]
    )
    assert np.abs(TASK.observation.to_network(rows)).max() < 2.0


def test_expert_looks_only_at_the_observation_and_stays_in_the_search_spaces():
    rows = observation(TASK.draw_instance(np.random.default_rng(1)))
    arguments = TASK.expert_arguments(rows, 0)
    normalised = TASK.pairs.to_normalised(arguments)
    assert (np.abs(normalised) <= 1.0).all()


def test_every_field_is_documented():
    page = (Path(__file__).parents[2] / "docs/tasks/lateral-lifting.md").read_text()
    for field in TASK.observation.fields:
        assert f"| `{field.name}` | {field.size} | {field.unit} | {field.meaning} |" in page
