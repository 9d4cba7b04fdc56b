import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taskschema.kinematics.rotation import (
    half_angle_cosine,
    matrix_to_quaternion,
    quaternion_conjugate,
    quaternion_product,
    rotate,
    rotation_error,
    same_hemisphere,
    vertical_turn,
)

HALF = np.sqrt(0.5)
components = st.floats(-1.0, 1.0)


def unit(values):
    quaternion = np.array(values) + np.array([1e-3, 0.0, 0.0, 0.0])
    return (quaternion / np.linalg.norm(quaternion))[None]


quaternions = st.tuples(components, components, components, components).map(unit)


def test_quarter_turns_by_hand():
    about_z, about_x = np.array([[HALF, 0, 0, HALF]]), np.array([[HALF, HALF, 0, 0]])
    # A quarter turn about z takes x to y; one about x takes y to z.
    np.testing.assert_allclose(rotate(about_z, np.array([[1.0, 0, 0]])), [[0, 1, 0]], atol=1e-15)
    both = quaternion_product(about_x, about_z)
    np.testing.assert_allclose(rotate(both, np.array([[1.0, 0, 0]])), [[0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(
        vertical_turn(np.array([np.pi / 2])), [[[0, -1, 0], [1, 0, 0], [0, 0, 1]]], atol=1e-15
    )


@given(quaternions)
def test_matrix_to_quaternion_inverts_rotation(quaternion):
    matrix = np.stack([rotate(quaternion, axis[None]) for axis in np.eye(3)], axis=-1)
    back = same_hemisphere(matrix_to_quaternion(matrix), quaternion[0])
    np.testing.assert_allclose(back, quaternion, atol=1e-7)


@given(quaternions, quaternions)
def test_conjugate_undoes_a_product(first, second):
    product = quaternion_product(first, second)
    np.testing.assert_allclose(quaternion_product(quaternion_conjugate(first), product), second, atol=1e-12)


@given(st.floats(-3.1, 3.1))
def test_rotation_error_is_the_angle_about_the_axis(angle):
    current, target = vertical_turn(np.array([0.4])), vertical_turn(np.array([0.4 + angle]))
    np.testing.assert_allclose(rotation_error(target, current), [[0, 0, angle]], atol=1e-9)


def test_half_angle_between_orientations_by_hand():
    """Between no turn and a quarter turn about z: cos 45 degrees, whichever sign the quaternions have."""
    none, quarter = np.array([[1.0, 0, 0, 0]]), np.array([[HALF, 0, 0, HALF]])
    np.testing.assert_allclose(half_angle_cosine(none, quarter), HALF, atol=1e-15)
    np.testing.assert_allclose(half_angle_cosine(-none, quarter), HALF, atol=1e-15)
    np.testing.assert_allclose(half_angle_cosine(quarter, quarter), 1.0, atol=1e-15)


@given(quaternions, quaternions)
def test_half_angle_is_the_relative_rotation_s(one, other):
    relative = quaternion_product(one, quaternion_conjugate(other))
    np.testing.assert_allclose(half_angle_cosine(one, other), np.abs(relative[:, 0]), atol=1e-12)
