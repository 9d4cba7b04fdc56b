import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskschema.kinematics.sawyer import sawyer
from taskschema.motion import ArmPath
from taskschema.motion.timing import PathLimits, fastest_path

ARM = sawyer()
OPEN = np.array([0.05])


def waypoints(seed, count=4, size=0.4):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (3, 1, 7)) + np.cumsum(rng.normal(0, size, (3, count, 7)), axis=1)


def assert_within_limits(path):
    """Check set-points every millisecond."""
    times = np.arange(0.0, path.duration.max() + 0.002, 0.001)
    joints, velocities, _ = path.sample(times)
    assert (np.abs(velocities) <= ARM.velocity).all()
    # Away from knots the difference quotient is the acceleration; at knots it averages the two sides.
    assert (np.abs(np.diff(velocities, axis=1)) / 0.001 <= ARM.acceleration * 1.001).all()
    np.testing.assert_allclose(np.diff(joints, axis=1) / 0.001, velocities[:, 1:], atol=0.02)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 6), st.sampled_from([0.01, 0.1, 0.5]))
def test_limits_hold_along_any_path(seed, count, size):
    assert_within_limits(fastest_path(ARM, waypoints(seed, count, size), np.full(3, 0.05)))


def test_path_passes_its_waypoints_and_rests_at_both_ends():
    points = waypoints(seed=1, count=3)
    path = fastest_path(ARM, points, np.full(3, 0.05), grid=8)
    np.testing.assert_allclose(path.joints[:, [0, 8, 16]], points, atol=1e-12)
    np.testing.assert_array_equal(path.velocities[:, [0, -1]], 0.0)


def test_fastest_straight_motion_by_hand():
    """One joint, 0.1 rad: too short for top speed, so 2 sqrt(distance / acceleration), at 92 % of it."""
    points = np.zeros((1, 2, 7))
    points[0, 1, 0] = 0.1
    path = fastest_path(ARM, points, OPEN, grid=64)
    assert path.duration[0] == pytest.approx(2 * np.sqrt(0.1 / 9.2), rel=0.02)


def test_path_limits_by_hand():
    """0.3 m at 0.3 m/s and 1 m/s^2: 0.3 s to speed over 0.045 m, 0.21 m at speed, 0.3 s to rest: 1.3 s."""
    points = np.zeros((1, 2, 7))
    points[0, 1, 0] = 0.01
    path = fastest_path(
        ARM, points, OPEN, lengths=np.array([[0.3]]), limits=PathLimits(speed=0.3, acceleration=1.0), grid=64
    )
    assert path.duration[0] == pytest.approx(1.3, rel=0.01)


def test_no_distance_takes_no_time():
    assert fastest_path(ARM, np.zeros((2, 3, 7)), np.zeros(2)).duration.tolist() == [0.0, 0.0]


def test_path_holds_after_its_end_and_switches_the_gripper_when_told():
    points = waypoints(seed=2, count=2)
    moved = fastest_path(ARM, points, np.full(3, 0.07))
    path = moved.then_grip(np.full(3, 0.0), np.full(3, 0.2))
    np.testing.assert_allclose(path.duration, moved.duration + 0.2)
    joints, velocities, opening = path.sample(np.array([0.0, 1e-3, 100.0]))
    np.testing.assert_allclose(joints[:, 2], points[:, 1], atol=1e-12)
    np.testing.assert_array_equal(velocities[:, 2], 0.0)
    np.testing.assert_array_equal(opening, [[0.07, 0.07, 0.0]] * 3)


def test_stay_takes_no_time():
    path = ArmPath.stay(np.ones((2, 7)), np.array([0.01, 0.02]))
    joints, velocities, opening = path.sample(np.array([0.0, 1.0]))
    assert (joints == 1).all()
    assert (velocities == 0).all()
    np.testing.assert_array_equal(opening, [[0.01, 0.01], [0.02, 0.02]])


@pytest.mark.parametrize("rows", [[0], [2], [1, 2]])
def test_rows_have_the_same_bits_in_any_batch(rows):
    points = waypoints(seed=5)
    times = np.linspace(0, 2, 77)
    everything = fastest_path(ARM, points, np.full(3, 0.05)).sample(times)
    part = fastest_path(ARM, points[rows], np.full(len(rows), 0.05)).sample(times)
    for whole, some in zip(everything, part, strict=True):
        np.testing.assert_array_equal(whole[rows], some)
