import numpy as np
import pytest

from taskschema.kinematics.inverse import ORIENTATION_TOLERANCE, POSITION_TOLERANCE, solve_inverse
from taskschema.kinematics.rotation import rotation_error, vertical_turn
from taskschema.kinematics.sawyer import NEUTRAL, sawyer, sawyer_pair, sawyers
from taskschema.skills.top_grasp import POINTING_DOWN

HOME = np.array([-0.47, -1.1, 0.0, 2.5, 0.0, 0.2, 1.3])


def reachable(count, seed):
    rng = np.random.default_rng(seed)
    position = rng.uniform([-0.2, -0.25, 0.0], [0.2, 0.2, 0.5], (count, 3))
    return position, vertical_turn(rng.uniform(-1.5, 1.5, count)) @ POINTING_DOWN


def test_stretched_arm_by_hand():
    # Link lengths of the Sawyer [m]: forward 0.081 + 0.4 + 0.4 + 0.11 to the last joint, 0.024 to the hand
    # and 0.109 to between the pads; sideways 0.1925 - 0.1685 + 0.1363; up 0.08 + 0.237.
    position, rotation = sawyer().forward(np.zeros((1, 7)))
    np.testing.assert_allclose(position, [[1.124, 0.1603, 0.317]], atol=1e-4)
    np.testing.assert_allclose(rotation[0, :, 2], [1, 0, 0], atol=1e-3)


def test_arms_face_each_other():
    (left, _), (right, _) = (arm.forward(np.array([NEUTRAL])) for arm in sawyer_pair())
    np.testing.assert_allclose(left * [-1, -1, 1], right, atol=1e-9)
    assert left[0, 1] < 0 < right[0, 1]


def test_jacobian_is_the_derivative_of_the_pose():
    joints, step = HOME[None], 1e-6
    arm = sawyer()
    position, rotation, jacobian = arm.forward_and_jacobian(joints)
    for joint in range(7):
        moved, turned = arm.forward(joints + step * np.eye(7)[joint])
        np.testing.assert_allclose((moved - position)[0] / step, jacobian[0, :3, joint], atol=1e-5)
        np.testing.assert_allclose(
            rotation_error(turned, rotation)[0] / step, jacobian[0, 3:, joint], atol=1e-4
        )


def test_inverse_reaches_what_can_be_reached():
    arm = sawyer_pair()[0]
    position, rotation = reachable(100, seed=0)
    result = solve_inverse(arm, position, rotation, np.tile(HOME, (100, 1)))
    assert result.reached.mean() >= 0.98
    found, facing = arm.forward(result.joints[result.reached])
    assert np.linalg.norm(found - position[result.reached], axis=1).max() < POSITION_TOLERANCE
    assert (
        np.linalg.norm(rotation_error(rotation[result.reached], facing), axis=1).max() < ORIENTATION_TOLERANCE
    )
    assert (result.joints >= arm.lower).all()
    assert (result.joints <= arm.upper).all()


def test_unreachable_orientation_gives_way_to_position():
    """At the end of the reach the hand cannot point down, but it can be there."""
    arm = sawyer_pair()[0]
    position = np.array([[0.0, -0.56 + 1.0, 0.25]])
    result = solve_inverse(arm, position, POINTING_DOWN[None], HOME[None])
    found, _ = arm.forward(result.joints)
    assert not result.reached[0]
    assert np.linalg.norm(found - position) < 0.01


def test_unreachable_position_is_approached():
    arm = sawyer_pair()[0]
    position = np.array([[0.0, 3.0, 0.3]])
    result = solve_inverse(arm, position, POINTING_DOWN[None], HOME[None])
    found, _ = arm.forward(result.joints)
    assert np.isfinite(result.joints).all()
    assert not result.reached[0]
    # Stretched towards the target: the reach from the shoulder is about 1.1 m.
    assert found[0, 1] > 0.35


@pytest.mark.parametrize("size", [1, 2, 3, 5, 17])
def test_rows_have_the_same_bits_in_any_batch(size):
    arm = sawyer_pair()[1]
    position, rotation = reachable(64, seed=3)
    position[::7] *= 4.0  # some out of reach, so that both passes run
    seeds = np.tile(HOME, (64, 1))
    everything = solve_inverse(arm, position, rotation, seeds)
    for trial in range(4):
        rows = np.random.default_rng(trial).choice(64, size, replace=False)
        part = solve_inverse(arm, position[rows], rotation[rows], seeds[rows])
        np.testing.assert_array_equal(part.joints, everything.joints[rows])
        np.testing.assert_array_equal(part.reached, everything.reached[rows])


def test_arms_in_one_batch_have_the_same_bits_as_each_alone():
    sides = np.array([0, 1, 1, 0, 1])
    position, rotation = reachable(5, seed=4)
    seeds = np.tile(HOME, (5, 1))
    together = solve_inverse(sawyers(sides), position, rotation, seeds)
    places, turns = sawyers(sides).forward(seeds)
    for side, arm in enumerate(sawyer_pair()):
        rows = np.flatnonzero(sides == side)
        alone = solve_inverse(arm, position[rows], rotation[rows], seeds[rows])
        np.testing.assert_array_equal(together.joints[rows], alone.joints)
        bases = sawyers(sides).rows(rows).base_position
        np.testing.assert_array_equal(bases, [arm.base_position] * len(rows))
        for batch, single in zip((places, turns), arm.forward(seeds[rows]), strict=True):
            np.testing.assert_array_equal(batch[rows], single)
