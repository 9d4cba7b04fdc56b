"""Rotating without a simulator: objects, goal, observation, expert."""

from pathlib import Path

import numpy as np
import pytest

from taskschema.tasks.registry import get_task
from taskschema.tasks.rotating import CORKSCREW_SIZE, Rotating
from taskschema.tasks.scene_observation import observe

TASK = Rotating()


def observation(instance):
    size = np.array([TASK.object_size]) * instance.scale
    rest = np.zeros((1, 2, 7))
    return observe(TASK.geometry, TASK.home_joints[None], rest, instance.pose[None], size, np.array([0]))


def test_it_is_registered_with_the_paper_s_schema_and_sixteen_pairs():
    task = get_task("rotating")
    assert isinstance(task, Rotating)
    assert task.paper_schema == (("go_to_pose", "side_grasp"), ("go_to_pose", "no_op"), ("rotate", "no_op"))
    assert len(task.pairs) == 16
    assert task.pairs.argument_count == 24


def test_location_and_size_vary():
    instances = [TASK.draw_instance(np.random.default_rng(seed)) for seed in range(200)]
    assert {len({getattr(item, name) for item in instances}) for name in ("position", "scale")} == {200}
    assert all(item.position[2] == pytest.approx(0.5 * CORKSCREW_SIZE[2] * item.scale) for item in instances)


@pytest.mark.parametrize(
    ("hinge", "shift", "reached"), [(3.15, 0.0, True), (3.13, 0.0, False), (3.15, 0.06, False)]
)
def test_goal_is_half_a_turn_of_the_hinge_on_a_base_that_keeps_its_pose(hinge, shift, reached):
    start = TASK.draw_instance(np.random.default_rng(0)).pose[None]
    pose = start[:, None].copy()
    pose[0, 0, 1] += shift
    pose[0, 0, 7] = hinge
    assert TASK.goal_reached(start, pose)[0, 0] == reached


def test_networks_see_numbers_of_about_one():
    rows = np.concatenate(
        [observation(TASK.draw_instance(np.random.default_rng(seed))) for seed in range(20)]
    )
    assert TASK.observation.size == 70
    assert np.abs(TASK.observation.to_network(rows)).max() < 2.0


def test_expert_stays_in_the_search_spaces_and_grows_with_the_corkscrew():
    small, large = (
        TASK.expert_arguments(observation(TASK.draw_corner(corner, np.random.default_rng(0))), 0)
        for corner in (0, 1)
    )
    assert (np.abs(TASK.pairs.to_normalised(np.concatenate([small, large]))) <= 1.0).all()
    radius = TASK.pairs.argument_names.index("left.rotate.radius")
    assert large[0, radius] > small[0, radius]


def test_every_field_is_documented():
    page = (Path(__file__).parents[2] / "docs/tasks/rotating.md").read_text()
    for field in TASK.observation.fields:
        assert f"| `{field.name}` | {field.size} | {field.unit} | {field.meaning} |" in page
