"""Go-to pose: where its hand goes, how it gets there, and how it keeps off the table."""

from dataclasses import replace

import numpy as np
import pytest

from taskschema.kinematics.euler import roll_pitch_yaw_quaternion
from taskschema.kinematics.rotation import rotate
from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair
from taskschema.motion import PlanningContext
from taskschema.motion.hand_clearance import TABLE_MARGIN, least_height, tilted_clear
from taskschema.skills.go_to_pose import APPROACH, CLEARANCE, SPEED
from taskschema.skills.registry import SKILLS
from taskschema.tasks.picking import BALL_RADIUS, Picking

TASK = Picking()
GO_TO_POSE = SKILLS["go_to_pose"]
FORWARD_AND_DOWN = 0.3 * np.pi
"""[rad] roll at which a hand that pointed down points along y and 36 degrees below the horizontal."""


def context(arm, count, opening=0.03, joints=None):
    return PlanningContext(
        arm=sawyer_pair()[arm],
        gripper=rethink_gripper(),
        joints=np.repeat(TASK.home_joints[arm][None], count, axis=0) if joints is None else joints,
        opening=np.full(count, opening),
        object_position=np.tile([0.02, -0.01, BALL_RADIUS], (count, 1)),
        object_quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        object_size=np.tile(TASK.object_size, (count, 1)),
        top_grasp_offset=np.zeros(count),
        side_grasp_offset=np.zeros(count),
        lift_speed=TASK.lift_speed,
    )


def random_rotations(count, seed=0):
    quaternion = np.random.default_rng(seed).standard_normal((count, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    return np.stack([rotate(quaternion, axis) for axis in np.eye(3)], axis=2)


@pytest.mark.parametrize(
    ("angles", "vector", "turned"),
    [
        ((np.pi / 2, 0, 0), (0, 0, 1), (0, -1, 0)),
        ((0, np.pi / 2, 0), (0, 0, 1), (1, 0, 0)),
        ((0, 0, np.pi / 2), (1, 0, 0), (0, 1, 0)),
        ((np.pi, 0, 0), (0, 0, 1), (0, 0, -1)),
        # Roll takes z to -y, which pitch leaves where it is, and yaw takes to x.
        ((np.pi / 2, np.pi / 2, np.pi / 2), (0, 0, 1), (1, 0, 0)),
    ],
)
def test_euler_angles_by_hand(angles, vector, turned):
    quaternion = roll_pitch_yaw_quaternion(np.array([angles]))
    np.testing.assert_allclose(rotate(quaternion, np.array(vector, dtype=float)), [turned], atol=1e-12)


@pytest.mark.parametrize("arm", [0, 1])
def test_hand_ends_at_its_pose_or_the_half_turn_of_it_with_its_gripper_as_it_was(arm):
    here = context(arm, 30)
    rng = np.random.default_rng(4)
    arguments = np.zeros((30, 6))
    arguments[:, :3] = rng.uniform((-0.1, -0.1, -0.02), 0.1, (30, 3))
    arguments[:, 3] = FORWARD_AND_DOWN + rng.uniform(-0.3, 0.3, 30)
    arguments[:, 5] = (np.pi if arm else 0.0) + rng.uniform(-0.3, 0.3, 30)
    path = GO_TO_POSE.plan(here, arguments)
    position, rotation = here.arm.forward(path.joints[:, -1])
    np.testing.assert_allclose(position, here.object_position + arguments[:, :3], atol=1e-3)
    quaternion = roll_pitch_yaw_quaternion(arguments[:, 3:])
    wanted = np.stack([rotate(quaternion, axis) for axis in np.diag([1.0, -1.0, -1.0])], axis=2)
    np.testing.assert_allclose(rotation[:, :, 2], wanted[:, :, 2], atol=5e-3)
    np.testing.assert_allclose(np.abs((rotation[:, :, 0] * wanted[:, :, 0]).sum(axis=1)), 1.0, atol=1e-3)
    assert (path.opening == 0.03).all()
    assert (path.velocities[:, -1] == 0).all()


@pytest.mark.parametrize("arm", [0, 1])
def test_middle_of_the_search_space_is_a_hand_that_points_straight_down(arm):
    here = context(arm, 1)
    path = GO_TO_POSE.plan(here, np.array([[0.0, 0.0, 0.1, np.pi, np.pi, np.pi]]))
    _, rotation = here.arm.forward(path.joints[:, -1])
    np.testing.assert_allclose(rotation[0, :, 2], [0.0, 0.0, -1.0], atol=5e-3)


@pytest.mark.parametrize("arm", [0, 1])
def test_half_a_turn_about_the_fingers_makes_no_difference(arm):
    """At the same place the gripper's other way round is the same pose: the nearer one is taken."""
    here = context(arm, 1)
    yaw = np.pi if arm else 0.0
    paths = [
        GO_TO_POSE.plan(here, np.array([[0.0, 0.0, 0.03, *angles]]))
        for angles in ((0.0, 0.0, yaw), (0.0, 0.0, np.pi - yaw))
    ]
    np.testing.assert_allclose(paths[0].joints[:, -1], paths[1].joints[:, -1], atol=5e-3)


@pytest.mark.parametrize("arm", [0, 1])
def test_last_part_is_straight_level_away_from_the_base_and_begins_clear_of_the_object(arm):
    here = context(arm, 8)
    arguments = np.zeros((8, 6))
    arguments[:, :2] = np.random.default_rng(0).uniform(-0.08, 0.08, (8, 2))
    arguments[:, 3], arguments[:, 5] = FORWARD_AND_DOWN, np.pi if arm else 0.0
    path = GO_TO_POSE.plan(here, arguments)
    for episode in range(8):
        goal = here.object_position[episode] + arguments[episode, :3]
        out = goal[:2] - here.arm.base_position[:2]
        out /= np.linalg.norm(out)
        approach = max(APPROACH, CLEARANCE + arguments[episode, :2] @ out)
        times = np.arange(path.duration[episode] - approach / SPEED, path.duration[episode], 0.01)
        joints, _, _ = path.sample(times)
        position, _ = here.arm.forward(joints[episode])
        offset = position - goal
        np.testing.assert_allclose(offset[:, :2], np.outer(offset[:, :2] @ out, out), atol=3e-3)
        np.testing.assert_allclose(offset[:, 2], 0.0, atol=3e-3)
        assert -approach - 1e-3 < (offset[0, :2] @ out) < -0.1
        speeds = np.linalg.norm(np.diff(position, axis=0), axis=1) / 0.01
        assert speeds.max() < SPEED * 1.05


@pytest.mark.parametrize("arm", [0, 1])
def test_hand_withdraws_level_from_the_object_before_it_turns(arm):
    """A hand beside the ball backs off towards its base: what it pressed on stays where it is."""
    here = context(arm, 1)
    pressing = np.array([[0.0, 0.0, -0.01, FORWARD_AND_DOWN, 0.0, np.pi if arm else 0.0]])
    beside = GO_TO_POSE.plan(here, pressing).joints[:, -1]
    start, _ = here.arm.forward(beside)
    turned = np.zeros((1, 6))
    turned[:, 2] = 0.05
    path = GO_TO_POSE.plan(replace(here, joints=beside), turned)
    positions, _ = here.arm.forward(path.joints[0])
    back = here.arm.base_position[:2] - here.object_position[0, :2]
    back /= np.linalg.norm(back)
    along = (positions[:, :2] - here.object_position[0, :2]) @ back
    clear = int(np.argmax(along > 0.9 * CLEARANCE))
    assert along.max() >= CLEARANCE - 2e-3
    np.testing.assert_allclose(positions[:clear, 2], start[0, 2], atol=0.03)
    assert (np.diff(along[: clear + 1]) >= -1e-4).all()


@pytest.mark.parametrize("arm", [0, 1])
def test_where_it_ends_does_not_depend_on_where_it_came_from(arm):
    """The same arguments mean the same posture, elbow up, whatever the arm did before."""
    here = context(arm, 12)
    rng = np.random.default_rng(6)
    strange = here.joints + rng.uniform(-0.8, 0.8, here.joints.shape)
    arguments = rng.uniform([-0.1] * 3 + [0] * 3, [0.1] * 3 + [2 * np.pi] * 3, (12, 6))
    ends = [GO_TO_POSE.plan(replace(here, joints=joints), arguments) for joints in (here.joints, strange)]
    np.testing.assert_array_equal(ends[0].joints[:, -1], ends[1].joints[:, -1])


def test_hands_are_tilted_only_as_far_as_the_table_makes_them():
    rotation, height = random_rotations(200), np.random.default_rng(1).uniform(0.02, 0.3, 200)
    tilted = tilted_clear(rotation, height)
    np.testing.assert_allclose(
        tilted @ tilted.transpose(0, 2, 1), np.tile(np.eye(3), (200, 1, 1)), atol=1e-12
    )
    same = rotation[:, 2, 2] <= tilted[:, 2, 2] + 1e-12
    np.testing.assert_allclose(tilted[same], rotation[same], atol=1e-9)
    # The others point along the same heading, and their wrist or palm is just above the table.
    bent = ~same
    assert bent.sum() > 20
    headings = [np.arctan2(item[bent, 1, 2], item[bent, 0, 2]) for item in (rotation, tilted)]
    aside = np.abs(np.sin(headings[0] - headings[1]))
    assert (aside < 1e-6).all()
    lowest = np.minimum(
        height[bent] - 0.15 * tilted[bent, 2, 2] - 0.05, height[bent] - 0.069 * tilted[bent, 2, 2] - 0.03
    )
    within = np.abs(tilted[bent, 2, 2]) < 1 - 1e-9
    np.testing.assert_allclose(lowest[within], TABLE_MARGIN, atol=1e-9)


def test_a_hand_that_points_straight_up_tilts_too():
    tilted = tilted_clear(np.eye(3)[None], np.array([0.06]))
    assert tilted[0, 2, 2] == pytest.approx((0.06 - 0.05 - TABLE_MARGIN) / 0.15)


def test_least_height_by_hand():
    """Pointing down the finger tips count, 13.9 mm beyond the end effector; level, the wrist of 50 mm."""
    down, level = np.diag([1.0, -1.0, -1.0]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    heights = least_height(np.stack([down, level]))
    np.testing.assert_allclose(heights, [0.0139 + TABLE_MARGIN, 0.05 + TABLE_MARGIN], atol=1e-9)


@pytest.mark.parametrize("arm", [0, 1])
def test_no_pose_is_in_the_table(arm):
    here = context(arm, 200)
    arguments = np.random.default_rng(3).uniform([-0.1] * 3 + [0] * 3, [0.1] * 3 + [2 * np.pi] * 3, (200, 6))
    path = GO_TO_POSE.plan(here, arguments)
    position, rotation = here.arm.forward(path.joints[:, -1])
    # Poses out of reach are met in position first, so that their orientation is another one.
    assert (position[:, 2] - least_height(rotation) > -2e-3).mean() > 0.8


def test_rows_have_the_same_bits_in_any_batch():
    arguments = np.random.default_rng(5).uniform([-0.1] * 3 + [0] * 3, [0.1] * 3 + [2 * np.pi] * 3, (21, 6))
    everything = GO_TO_POSE.plan(context(1, 21), arguments)
    for chosen in ([4], [0, 7], [3, 11, 19, 20, 2]):
        part = GO_TO_POSE.plan(context(1, len(chosen)), arguments[chosen])
        np.testing.assert_array_equal(part.joints, everything.joints[chosen])
        np.testing.assert_array_equal(part.times, everything.times[chosen])
