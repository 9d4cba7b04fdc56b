"""What the gate refuses before a motion: one small spoilt motion for each check."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from motions import BAR, PERIOD, grasp_of_the_bar, skill_motion, straight
from recording_arms import HOME, TestBench

from taskschema.errors import ConfigError
from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.sawyer import sawyer, sawyer_pair
from taskschema.safety.limits import Box, SafetyLimits
from taskschema.safety.motion import HeldObject, Motion
from taskschema.safety.refusal import RefusalKind
from taskschema.safety.step_motion import hand_goal
from taskschema.skills.registry import get_skill
from taskschema_robot.safety.picture import draw_motion

INSTANCE = BAR.draw_instance(np.random.default_rng(0))
POSE = np.array([*INSTANCE.position, *INSTANCE.quaternion])


def standing(joints=HOME, count=5) -> Motion:
    return Motion(np.repeat(joints[:, None], count, axis=1), np.full((2, count), 0.05), PERIOD)


def spoilt(**changes) -> Motion:
    return replace(standing(), **changes)


def with_joint(value: float, arm: int = 0, joint: int = 3, step: int = 2) -> Motion:
    motion = standing()
    motion.joints[arm, step, joint] = value
    return motion


def refused(motion: Motion, joints=HOME, limits=None):
    bench = TestBench(joints, limits)
    refusal = bench.gate.execute(motion)
    assert bench.sent == 0 or refusal is None
    assert bench.gate.fault is None
    return refusal


def lowered(arm: int, metres: float) -> np.ndarray:
    """Joint angles [7] with the hand that much below home."""
    kinematics, joints = sawyer_pair()[arm], HOME[arm : arm + 1]
    position, rotation = kinematics.forward(joints)
    return solve_inverse(kinematics, position - [0.0, 0.0, metres], rotation, joints).joints[0]


def test_a_motion_that_stays_is_let_through():
    assert refused(standing()) is None


@pytest.mark.parametrize(
    "motion",
    [
        with_joint(np.nan),
        with_joint(np.inf),
        spoilt(joints=np.zeros((2, 5, 6))),
        spoilt(joints=np.zeros((1, 5, 7))),
        spoilt(joints=np.zeros((2, 0, 7))),
        spoilt(joints=np.zeros((2, 5, 7), dtype=np.int64)),
        spoilt(joints=np.array([["a"] * 7] * 2)),
        spoilt(joints=[[0.0] * 7] * 2),
        spoilt(opening=np.zeros((2, 4))),
        spoilt(opening=np.full((2, 5), np.nan)),
        spoilt(period=0.001),
        spoilt(period=float("nan")),
        spoilt(goals=(np.array([np.nan, 0.0]), None)),
        spoilt(held=(HeldObject(np.zeros(3), np.zeros(3), np.eye(3)), None)),
    ],
)
def test_malformed_motions(motion):
    assert refused(motion).kind is RefusalKind.MALFORMED


def test_a_motion_may_not_take_for_ever():
    assert refused(standing(count=7000)).kind is RefusalKind.TOO_LONG


def test_a_motion_starts_where_the_arms_are():
    assert refused(standing(HOME + 0.05)).kind is RefusalKind.START


def test_joint_limits_hold_with_their_margin():
    limits, arm = SafetyLimits(), sawyer()
    near = HOME.copy()
    near[1, 6] = arm.upper[6] - 2.0 * limits.joint_margin
    end = near.copy()
    end[1, 6] = arm.upper[6] - 0.5 * limits.joint_margin
    refusal = refused(straight(near, end), near)
    assert refusal.kind is RefusalKind.JOINT_LIMIT
    assert "joint 6 of the right arm" in refusal.reason


def test_a_joint_inside_its_margin_may_leave_it_but_go_no_further():
    limits, arm = SafetyLimits(), sawyer()
    start, further, back = HOME.copy(), HOME.copy(), HOME.copy()
    start[0, 6] = arm.upper[6] - 0.5 * limits.joint_margin
    further[0, 6] = arm.upper[6] - 0.4 * limits.joint_margin
    back[0, 6] = arm.upper[6] - 0.5
    assert refused(straight(start, further), start).kind is RefusalKind.JOINT_LIMIT
    assert refused(straight(start, back), start) is None


def test_velocity_and_acceleration():
    # 0.02 rad in one period of 0.01 s is 2 rad/s; joint 3 may do 1.957 rad/s.
    motion = standing(count=60)
    motion.joints[0, 30:, 3] += 0.02
    assert refused(motion).kind is RefusalKind.VELOCITY
    # 0.002 rad in one period is 0.2 rad/s, but reached within it: 20 rad/s^2 of the 10 allowed.
    motion = standing(count=60)
    motion.joints[0, 30:, 3] += 0.002
    refusal = refused(motion)
    assert refusal.kind is RefusalKind.ACCELERATION
    assert refusal.time == pytest.approx(0.29)


def test_a_speed_ratio_slows_what_it_is_given():
    end = HOME.copy()
    end[:, 0] += 0.3
    slow = SafetyLimits(speed_ratio=0.5)
    assert refused(straight(HOME, end), limits=slow).kind is RefusalKind.VELOCITY
    assert refused(straight(HOME, end, speed_ratio=0.5), limits=slow) is None


def test_the_gripper_has_every_opening():
    assert refused(spoilt(opening=np.full((2, 5), 0.2))).kind is RefusalKind.GRIPPER


def test_the_hands_end_where_they_are_meant_to():
    motion = grasp_of_the_bar()
    assert refused(motion) is None
    far = replace(motion, goals=(np.array([0.5, 0.5]), None))
    assert refused(far).kind is RefusalKind.INVERSE_KINEMATICS


@pytest.mark.parametrize(("shift", "words"), [(0.05, "5.0 cm below"), (-0.05, "5.0 cm above")])
def test_the_hands_end_at_the_height_they_are_meant_to(shift, words):
    motion = skill_motion(HOME, ("lift", "no_op"), ([0.2], []))
    goal = hand_goal(get_skill("lift"), np.array([0.2]), POSE, 0, HOME[0])
    assert refused(replace(motion, goals=(goal, None))) is None
    refusal = refused(replace(motion, goals=(goal + np.array([0.0, 0.0, shift]), None)))
    assert refusal.kind is RefusalKind.INVERSE_KINEMATICS
    assert refusal.reason == f"the left hand would end {words} where it was meant to"


@pytest.mark.parametrize("z", [0.08, -0.1])
def test_a_go_to_pose_ends_where_its_arguments_say_or_as_low_as_the_table_lets_it(z):
    values = np.array([0.0, 0.08, z, np.pi, np.pi, np.pi])
    motion = skill_motion(HOME, ("no_op", "go_to_pose"), ([], values))
    goal = hand_goal(get_skill("go_to_pose"), values, POSE, 1, HOME[1])
    assert goal[2] == pytest.approx(POSE[2] + z) if z > 0.0 else goal[2] > 0.0
    assert refused(replace(motion, goals=(None, goal))) is None
    wrong = replace(motion, goals=(None, goal + np.array([0.0, 0.0, 0.05])))
    assert refused(wrong).reason == "the right hand would end 5.0 cm below where it was meant to"


def test_workspace_of_all_links():
    end = HOME.copy()
    end[0, 0] += 1.2  # the left arm swings out to its side
    tight = SafetyLimits(workspace=Box((-0.3, -0.95, -0.05), (0.3, 0.95, 1.3)))
    assert refused(straight(HOME, end)) is None
    assert refused(straight(HOME, end), limits=tight).kind is RefusalKind.WORKSPACE


def test_hands_that_would_meet():
    motion = skill_motion(HOME, ("top_grasp", "top_grasp"), ([0.0, 0.0, 2.4], [0.0, 0.0, 2.4]))
    refusal = refused(motion)
    assert refusal.kind is RefusalKind.ARMS_COLLIDE
    assert refusal.configuration.shape == (2, 7)


def test_an_arm_that_would_swing_through_the_other_is_caught_between_its_ends():
    # Both ends are clear: the left hand passes the right arm's place from one side to the other.
    start, end = HOME.copy(), HOME.copy()
    start[0, 0], end[0, 0] = 0.9, -0.9
    start[0, 1] = end[0, 1] = -0.6
    start[0, 3] = end[0, 3] = 1.2
    assert refused(standing(start), start) is None
    assert refused(standing(end), end) is None
    refusal = refused(straight(start, end), start)
    assert refusal.kind is RefusalKind.ARMS_COLLIDE
    assert 0.0 < refusal.time < straight(start, end).duration


def test_a_link_that_would_hit_the_table():
    end = HOME.copy()
    end[1] = lowered(1, 0.16)
    assert refused(straight(HOME, end)).kind is RefusalKind.TABLE


def test_an_arm_that_would_fold_into_itself():
    start = HOME.copy()
    end = start.copy()
    start[0, 1], start[0, 3] = -1.2, 1.2
    end[0] = start[0]
    end[0, 3], end[0, 5] = 3.0, 2.9
    assert refused(straight(start, end), start).kind is RefusalKind.SELF_COLLISION


def test_what_a_hand_holds_is_swept_too():
    # The right hand turns a board through the left arm; empty-handed, it may.
    end = HOME.copy()
    end[1, 6] -= 1.2
    motion = straight(HOME, end)
    assert refused(motion) is None
    board = HeldObject(np.array([0.9, 0.016, 0.2]), np.array([0.0, 0.0, -0.1]), np.eye(3))
    assert refused(replace(motion, held=(None, board))).kind is RefusalKind.HELD_OBJECT


def test_what_a_hand_holds_is_not_pressed_into_the_table():
    lifted = skill_motion(HOME, ("lift", "no_op"), ([0.2], []))
    rod = HeldObject(np.array([0.02, 0.02, 0.4]), np.zeros(3), np.eye(3))
    end = lifted.joints[:, -1].copy()
    down = replace(straight(end, HOME), held=(rod, None))
    assert refused(down, end).kind is RefusalKind.HELD_OBJECT
    assert refused(replace(lifted, held=(rod, None))) is None


def test_an_end_point_that_is_too_near_is_refused_though_the_way_is_clear():
    bench = TestBench()
    motion = grasp_of_the_bar()
    low = replace(motion, joints=motion.joints.copy())
    assert bench.gate.check(motion) is None
    strict = TestBench(limits=SafetyLimits(finger_clearance=0.0075))
    refusal = strict.gate.check(low)
    assert refusal.kind is RefusalKind.TABLE
    assert refusal.time > 0.8 * motion.duration - 0.5


def test_limits_must_make_sense():
    with pytest.raises(ConfigError, match="Speed"):
        SafetyLimits(speed_ratio=1.5)
    with pytest.raises(ConfigError, match="joint_margin"):
        SafetyLimits(joint_margin=float("nan"))
    with pytest.raises(ConfigError, match="below upper"):
        Box((0.0, 0.0, 0.0), (1.0, 0.0, 1.0))


def test_a_refused_plan_has_a_picture(tmp_path):
    motion = skill_motion(HOME, ("top_grasp", "top_grasp"), ([0.0, 0.0, 2.4], [0.0, 0.0, 2.4]))
    refusal = refused(motion)
    draw_motion(tmp_path / "refused.png", motion, refusal, "top grasp, top grasp")
    picture = cv2.imread(str(tmp_path / "refused.png"))
    red = (picture[..., 2] > 200) & (picture[..., 1] < 50) & (picture[..., 0] < 50)
    assert red.sum() > 40
