"""The skills' plans: search spaces, limits, end states, unreachable targets."""

from pathlib import Path

import numpy as np
import pytest

from taskschema.errors import UnknownNameError
from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair
from taskschema.motion import PlanningContext
from taskschema.skills.registry import SKILLS, get_skill
from taskschema.skills.skill import Skill
from taskschema.tasks.lateral_lifting import BAR_SIZE, LateralLifting

TASK = LateralLifting()
GRIPPER = rethink_gripper()
LIFT_SPEED = 0.4


def context(arm=0, count=1, joints=None, opening=None, seed=0):
    rng = np.random.default_rng(seed)
    poses = np.stack([TASK.draw_instance(rng).pose for _ in range(count)])
    return PlanningContext(
        arm=sawyer_pair()[arm],
        gripper=GRIPPER,
        joints=np.repeat(TASK.home_joints[arm][None], count, axis=0) if joints is None else joints,
        opening=np.full(count, GRIPPER.open if opening is None else opening),
        object_position=poses[:, :3],
        object_quaternion=poses[:, 3:],
        object_size=np.tile(BAR_SIZE, (count, 1)),
        top_grasp_offset=np.zeros(count),
        side_grasp_offset=np.zeros(count),
        lift_speed=LIFT_SPEED,
    )


def random_arguments(skill, count, seed=0):
    low = [argument.low for argument in skill.arguments]
    high = [argument.high for argument in skill.arguments]
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def assert_within_limits(path, arm):
    times = np.arange(0.0, path.duration.max() + 0.002, 0.001)
    joints, velocities, _ = path.sample(times)
    assert (joints >= arm.lower - 1e-5).all()
    assert (joints <= arm.upper + 1e-5).all()
    assert (np.abs(velocities) <= arm.velocity * 1.001).all()
    assert (np.abs(np.diff(velocities, axis=1)) / 0.001 <= arm.acceleration * 1.001).all()


def test_search_spaces_are_the_paper_s():
    spaces = {
        name: [(item.name, item.unit, item.low, item.high) for item in SKILLS[name].arguments]
        for name in SKILLS
    }
    assert spaces["top_grasp"] == [
        ("x", "m", -0.1, 0.1),
        ("y", "m", -0.1, 0.1),
        ("z_orientation", "rad", 0.0, 2 * np.pi),
    ]
    assert spaces["side_grasp"] == [
        ("x", "m", -0.1, 0.1),
        ("y", "m", -0.1, 0.1),
        ("approach_angle", "rad", -np.pi / 2, np.pi / 2),
    ]
    assert spaces["go_to_pose"] == [
        *((axis, "m", -0.1, 0.1) for axis in "xyz"),
        *((angle, "rad", 0.0, 2 * np.pi) for angle in ("roll", "pitch", "yaw")),
    ]
    assert spaces["rotate"] == [("x", "m", -0.1, 0.1), ("y", "m", -0.1, 0.1), ("radius", "m", 0.0, 0.2)]
    assert spaces["twist"] == []
    assert spaces["lift"] == [("distance", "m", 0.0, 0.5)]
    assert spaces["no_op"] == []
    assert [item.name for skill in SKILLS.values() for item in skill.arguments if item.periodic] == [
        "z_orientation",
        "roll",
        "pitch",
        "yaw",
    ]


@pytest.mark.parametrize("name", list(SKILLS))
def test_every_registered_skill_is_described(name):
    skill = get_skill(name)
    assert isinstance(skill, Skill)
    assert skill.name == name
    assert all([skill.summary, skill.families, skill.start_state, skill.end_state])
    assert all(argument.meaning for argument in skill.arguments)


@pytest.mark.parametrize("name", list(SKILLS))
def test_every_registered_skill_has_a_page(name):
    skill = get_skill(name)
    page = (Path(__file__).parents[2] / f"docs/skills/{name.replace('_', '-')}.md").read_text()
    ends = {"0": 0.0, "2 pi": 2 * np.pi, "pi/2": np.pi / 2, "-pi/2": -np.pi / 2}
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| `")]
    assert [(row[0].strip("`"), row[1], row[4]) for row in rows] == [
        (argument.name, argument.unit, argument.meaning) for argument in skill.arguments
    ]
    for row, argument in zip(rows, skill.arguments, strict=True):
        low, high = (ends[end] if end in ends else float(end) for end in row[2].split(" to "))
        assert (low, high) == (argument.low, argument.high)
    assert f"| start | {skill.start_state} |" in page
    assert f"| end | {skill.end_state} |" in page


def test_unknown_skill_lists_the_valid_ones():
    with pytest.raises(UnknownNameError, match="Did you mean 'lift'.*no_op, .*top_grasp"):
        get_skill("lft")


@pytest.mark.parametrize("arm", [0, 1])
@pytest.mark.parametrize("names", [("top_grasp", "lift"), ("side_grasp", "twist"), ("go_to_pose", "rotate")])
def test_chains_of_random_motions_keep_the_sawyer_s_limits(names, arm):
    """Lifts out of reach leave joints at their limits, from where the next grasp sets out."""
    joints = None
    for number, name in enumerate(names * 3):
        here = context(arm, 60, joints, opening=GRIPPER.closed if number else None)
        path = SKILLS[name].plan(here, random_arguments(SKILLS[name], 60, seed=number))
        assert_within_limits(path, here.arm)
        joints = path.joints[:, -1]


@pytest.mark.parametrize("arm", [0, 1])
@pytest.mark.parametrize("name", list(SKILLS))
def test_plans_keep_the_sawyer_s_limits(name, arm):
    """From home, and again from wherever the plan led, with the gripper closed."""
    skill, here = SKILLS[name], context(arm, count=60)
    for seed in (1, 2):
        path = skill.plan(here, random_arguments(skill, 60, seed))
        assert_within_limits(path, here.arm)
        np.testing.assert_allclose(path.sample(np.zeros(1))[0][:, 0], here.joints, atol=1e-9)
        here = context(arm, count=60, joints=path.joints[:, -1], opening=GRIPPER.closed)


def test_set_points_at_robot_rate_stay_within_stopping_distance():
    """At 100 Hz no set-point is further from the last than the joint's top speed allows."""
    here = context(count=20)
    path = SKILLS["top_grasp"].plan(here, random_arguments(SKILLS["top_grasp"], 20))
    joints, _, _ = path.sample(np.arange(0, path.duration.max(), 0.01))
    assert (np.abs(np.diff(joints, axis=1)) <= here.arm.velocity * 0.01 * 1.001).all()


def test_top_grasp_ends_at_its_point_pointing_down_and_closed():
    here = context(count=30)
    arguments = random_arguments(SKILLS["top_grasp"], 30)
    path = SKILLS["top_grasp"].plan(here, arguments)
    position, rotation = here.arm.forward(path.joints[:, -1])
    np.testing.assert_allclose(position[:, :2], here.object_position[:, :2] + arguments[:, :2], atol=1e-3)
    np.testing.assert_allclose(rotation[:, :, 2], np.tile([0, 0, -1], (30, 1)), atol=2e-3)
    assert (position[:, 2] - GRIPPER.fingertip > 0.004).all()
    assert (path.opening[:, -1] == GRIPPER.closed).all()
    # The gripper is symmetric: its closing axis lies along the orientation asked for, either way round.
    along = np.stack([np.cos(arguments[:, 2]), np.sin(arguments[:, 2])], axis=1)
    np.testing.assert_allclose(np.abs((rotation[:, :2, 0] * along).sum(axis=1)), 1.0, atol=1e-4)


def test_closed_gripper_opens_before_the_hand_moves_and_a_low_hand_rises_first():
    low = context(count=5)
    grasped = SKILLS["top_grasp"].plan(low, random_arguments(SKILLS["top_grasp"], 5)).joints[:, -1]
    here = context(count=5, joints=grasped, opening=GRIPPER.closed)
    path = SKILLS["top_grasp"].plan(here, random_arguments(SKILLS["top_grasp"], 5, seed=9))
    joints, _, opening = path.sample(np.arange(0.0, path.duration.max(), 0.01))
    still = np.abs(joints - grasped[:, None]).max(axis=2) < 1e-6
    assert (opening[still & (np.arange(opening.shape[1]) < 10)] == GRIPPER.open).all()
    start, _ = here.arm.forward(grasped)
    position = np.stack([here.arm.forward(row)[0] for row in joints.transpose(1, 0, 2)], axis=1)
    sideways = np.linalg.norm(position[:, :, :2] - start[:, None, :2], axis=2)
    tips = position[:, :, 2] - GRIPPER.fingertip
    # Until the hand has cleared the bar it does not move sideways by more than the joint path's sag.
    assert sideways[(tips < BAR_SIZE[2]) & (np.arange(tips.shape[1]) < 30)].max() < 0.012


def test_lift_is_straight_up_by_its_distance():
    here = context(count=20)
    grasped = SKILLS["top_grasp"].plan(here, random_arguments(SKILLS["top_grasp"], 20)).joints[:, -1]
    here = context(count=20, joints=grasped, opening=GRIPPER.closed)
    distance = np.linspace(0.0, 0.45, 20)
    path = SKILLS["lift"].plan(here, distance[:, None])
    start, facing = here.arm.forward(grasped)
    times = np.arange(0.0, path.duration.max(), 0.05)
    joints, _, opening = path.sample(times)
    for row in joints.transpose(1, 0, 2):
        position, rotation = here.arm.forward(row)
        np.testing.assert_allclose(position[:, :2], start[:, :2], atol=2e-3)
        np.testing.assert_allclose(rotation, facing, atol=0.02)
    position, _ = here.arm.forward(path.joints[:, -1])
    np.testing.assert_allclose(position[:, 2] - start[:, 2], distance, atol=1e-3)
    assert path.duration[0] == 0.0
    assert (opening == GRIPPER.closed).all()


def test_both_arms_lift_at_the_same_speed():
    """Otherwise two lifts that are both long enough would tilt what they hold."""
    heights = []
    for arm, distance in ((0, 0.3), (1, 0.5)):
        grasp = np.array([[0.05, 0.05, np.pi / 4]]) * (-1 if arm == 0 else 1)
        down = SKILLS["top_grasp"].plan(context(arm), np.mod(grasp, [1, 1, 2 * np.pi]) if arm else grasp)
        here = context(arm, joints=down.joints[:, -1], opening=GRIPPER.closed)
        path = SKILLS["lift"].plan(here, np.array([[distance]]))
        joints, _, _ = path.sample(np.arange(0.0, 0.6, 0.05))
        position = here.arm.forward(joints[0])[0]
        heights.append(position[:, 2] - position[0, 2])
    np.testing.assert_allclose(heights[0], heights[1], atol=2e-3)
    assert heights[0][-1] - heights[0][-2] == pytest.approx(LIFT_SPEED * 0.05, rel=0.05)


@pytest.mark.parametrize("arm", [0, 1])
def test_side_grasp_ends_level_at_its_point_pointing_along_its_angle_and_closed(arm):
    here, skill = context(arm, count=40), SKILLS["side_grasp"]
    here.side_grasp_offset[:] = 0.08
    arguments = random_arguments(skill, 40)
    path = skill.plan(here, arguments)
    position, rotation = here.arm.forward(path.joints[:, -1])
    np.testing.assert_allclose(position[:, :2], here.object_position[:, :2] + arguments[:, :2], atol=1e-3)
    np.testing.assert_allclose(position[:, 2], BAR_SIZE[2] / 2 + 0.08, atol=1e-3)
    heading = arguments[:, 2] + (np.pi / 2 if arm == 0 else -np.pi / 2)
    fingers = np.stack([np.cos(heading), np.sin(heading), np.zeros(40)], axis=1)
    np.testing.assert_allclose(rotation[:, :, 2], fingers, atol=2e-3)
    np.testing.assert_allclose(rotation[:, 2, 0], 0.0, atol=2e-3)  # closes level
    assert (path.opening[:, -1] == GRIPPER.closed).all()


def test_side_grasp_keeps_clear_of_the_table_and_comes_in_straight():
    here, skill = context(count=20), SKILLS["side_grasp"]
    arguments = random_arguments(skill, 20)
    path = skill.plan(here, arguments)
    times = np.arange(0.0, path.duration.max(), 0.01)
    joints, _, opening = path.sample(times)
    end, rotation = here.arm.forward(path.joints[:, -1])
    np.testing.assert_allclose(end[:, 2], 0.06, atol=1e-3)
    for episode in range(20):
        position, _ = here.arm.forward(joints[episode])
        offset = position - end[episode]
        distance = np.linalg.norm(offset, axis=1)
        last = offset[np.flatnonzero(distance > 0.1)[-1] + 1 :]
        fingers = rotation[episode, :, 2]
        aside = np.linalg.norm(last - np.outer(last @ fingers, fingers), axis=1)
        assert aside.max() < 0.015
    assert (opening[:, 0] == GRIPPER.open).all()


def test_closed_hand_backs_off_along_its_fingers_before_a_side_grasp():
    first = SKILLS["top_grasp"].plan(context(count=5), random_arguments(SKILLS["top_grasp"], 5))
    here = context(count=5, joints=first.joints[:, -1], opening=GRIPPER.closed)
    path = SKILLS["side_grasp"].plan(here, random_arguments(SKILLS["side_grasp"], 5, seed=4))
    start, facing = here.arm.forward(here.joints)
    joints, _, opening = path.sample(np.arange(0.0, 0.15, 0.01))
    assert (np.abs(joints - here.joints[:, None]) < 1e-9).all()
    assert (opening == GRIPPER.open).all()
    joints, _, _ = path.sample(np.arange(0.15, path.duration.max(), 0.01))
    risen = np.stack([here.arm.forward(row)[0][:, 2] for row in joints.transpose(1, 0, 2)]) - start[:, 2]
    assert (risen.max(axis=0) > 0.099).all()


def test_twist_turns_the_hand_in_place_counterclockwise_seen_from_the_hand():
    down = SKILLS["top_grasp"].plan(context(count=10), random_arguments(SKILLS["top_grasp"], 10))
    here = context(count=10, joints=down.joints[:, -1], opening=GRIPPER.closed)
    path = SKILLS["twist"].plan(here, np.empty((10, 0)))
    before, facing = here.arm.forward(here.joints)
    after, turned = here.arm.forward(path.joints[:, -1])
    np.testing.assert_allclose(after, before, atol=1e-4)
    # The hand points down, so that this is counterclockwise about the world's z axis.
    angle = np.arctan2(turned[:, 1, 0], turned[:, 0, 0]) - np.arctan2(facing[:, 1, 0], facing[:, 0, 0])
    np.testing.assert_allclose(np.mod(angle, 2 * np.pi), np.deg2rad(150), atol=2e-3)
    assert (path.opening == GRIPPER.closed).all()


@pytest.mark.parametrize("arm", [0, 1])
def test_rotate_goes_once_around_its_axis_counterclockwise_with_height_and_orientation_kept(arm):
    here, skill = context(arm, count=12), SKILLS["rotate"]
    arguments = random_arguments(skill, 12)
    arguments[:, 2] = np.linspace(0.03, 0.1, 12)
    path = skill.plan(here, arguments)
    start, facing = here.arm.forward(here.joints)
    axis = here.object_position[:, :2] + arguments[:, :2]
    times = np.arange(0.0, path.duration.max(), 0.02)
    sampled, _, _ = path.sample(times)
    for episode in range(12):
        joints = sampled[episode, times < path.duration[episode]]
        position, rotation = here.arm.forward(joints)
        np.testing.assert_allclose(position[:, 2], start[episode, 2], atol=0.006)
        offset = position[:, :2] - axis[episode]
        circling = np.flatnonzero(np.abs(np.linalg.norm(offset, axis=1) - arguments[episode, 2]) > 0.004)[-1]
        angles = np.unwrap(np.arctan2(offset[circling + 1 :, 1], offset[circling + 1 :, 0]))
        assert angles[-1] - angles[0] > 0.9 * 2 * np.pi
        assert (np.diff(angles) > -0.05).all()
        np.testing.assert_allclose(rotation - facing[episode], 0.0, atol=0.04)
    # It comes onto the circle where the hand is nearest to it, and ends there.
    end, _ = here.arm.forward(path.joints[:, -1])
    direction = start[:, :2] - axis
    nearest = axis + arguments[:, 2:] * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    np.testing.assert_allclose(end[:, :2], nearest, atol=2e-3)
    assert (path.opening == here.opening[0]).all()


def test_twist_stops_at_the_wrist_s_limit():
    here = context(count=1)
    here.joints[:, 6] = here.arm.lower[6] + 0.5
    path = SKILLS["twist"].plan(here, np.empty((1, 0)))
    assert path.joints[0, -1, 6] == here.arm.lower[6]


@pytest.mark.parametrize("name", ["top_grasp", "side_grasp", "go_to_pose", "rotate", "lift"])
def test_unreachable_target_is_a_normal_outcome(name):
    """An object out of reach, and a lift beyond the arm's height: the plan goes as near as it can."""
    here = context(count=4)
    here.object_position[:, 1] += 2.0
    path = SKILLS[name].plan(here, np.full((4, len(SKILLS[name].arguments)), 0.5))
    assert np.isfinite(path.joints).all()
    assert np.isfinite(path.times).all()
    assert_within_limits(path, here.arm)


def test_no_op_takes_no_time_and_keeps_the_gripper():
    here = context(count=3, opening=0.03)
    path = SKILLS["no_op"].plan(here, np.empty((3, 0)))
    assert (path.duration == 0).all()
    np.testing.assert_array_equal(path.joints[:, -1], here.joints)
    assert (path.opening == 0.03).all()
