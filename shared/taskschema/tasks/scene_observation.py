"""The low-dimensional state of the paper (section IV-A): its fields, and how they are computed.

Density and friction are not in it: the paper varies them without showing them.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.kinematics.rotation import (
    matrix_to_quaternion,
    quaternion_conjugate,
    quaternion_product,
    rotate,
    same_hemisphere,
)
from taskschema.kinematics.sawyer import sawyer, sawyer_pair
from taskschema.observation import ObservationField, ObservationLayout
from taskschema.skills.pairs import ARMS

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """What is the same in every episode of a task."""

    object_size: tuple[float, float, float]
    """Edge lengths of the object at scale 1 [m]."""
    home_joints: FloatArray
    """[2, 7] both arms at the start of an episode [rad]."""
    horizon: int
    """T"""
    object_joints: tuple[str, ...] = ()
    """Names of the object's own joints."""

    @cached_property
    def home_poses(self) -> tuple[FloatArray, FloatArray]:
        """[2, 3] positions [m] and [2, 4] quaternions of both end effectors at the start of an episode."""
        poses = [
            arm.forward(joints[None]) for arm, joints in zip(sawyer_pair(), self.home_joints, strict=True)
        ]
        return (
            np.concatenate([position for position, _ in poses]),
            np.concatenate([matrix_to_quaternion(rotation) for _, rotation in poses]),
        )

    @cached_property
    def home_object_quaternions(self) -> FloatArray:
        """[2, 4] an unturned object's orientation in both hands' frames at the start of an episode."""
        return quaternion_conjugate(self.home_poses[1])


def scene_layout(geometry: SceneGeometry) -> ObservationLayout:
    """Return the fields, scaled so that a network sees numbers of about 1."""
    positions, quaternions = geometry.home_poses
    fields = []
    for index, arm in enumerate(ARMS):
        home = geometry.home_joints[index].tolist()
        fields += [
            ObservationField(
                f"{arm}.joint_positions", 7, "rad", f"Joint angles of the {arm} arm.", tuple(home), 0.5
            ),
            ObservationField(
                f"{arm}.joint_velocities",
                7,
                "rad/s",
                f"Joint velocities of the {arm} arm.",
                0.0,
                tuple((0.25 * sawyer().velocity).tolist()),
            ),
            ObservationField(
                f"{arm}.end_effector_position",
                3,
                "m",
                f"Point between the {arm} gripper's pads, world frame.",
                tuple(positions[index].round(9).tolist()),
                0.2,
            ),
            ObservationField(
                f"{arm}.end_effector_quaternion",
                4,
                "1",
                f"Orientation of the {arm} end effector, w x y z, world frame.",
                tuple(quaternions[index].round(9).tolist()),
                0.5,
            ),
        ]
    fields += [
        ObservationField(
            "timestep", geometry.horizon, "1", "One-hot number of the step, from 0; zeros at the end."
        ),
        ObservationField(
            "object.size", 3, "m", "Edge lengths of the object, its own frame.", geometry.object_size, 0.1
        ),
        ObservationField(
            "object.position", 3, "m", "Centre of the object, world frame.", (0.0, 0.0, 0.05), 0.1
        ),
        ObservationField(
            "object.quaternion",
            4,
            "1",
            "Orientation of the object, w x y z, world frame.",
            (1.0, 0.0, 0.0, 0.0),
            0.5,
        ),
    ]
    fields += [
        ObservationField(f"object.{name}", 1, "rad", f"Angle of the object's {name}.", 0.0, 1.0)
        for name in geometry.object_joints
    ]
    for index, arm in enumerate(ARMS):
        relative = rotate(geometry.home_object_quaternions[index], -positions[index])
        fields += [
            ObservationField(
                f"object.position_in_{arm}_hand",
                3,
                "m",
                f"Centre of the object, {arm} end effector's frame.",
                tuple(relative.round(9).tolist()),
                0.2,
            ),
            ObservationField(
                f"object.quaternion_in_{arm}_hand",
                4,
                "1",
                f"Orientation of the object, w x y z, {arm} end effector's frame.",
                tuple(geometry.home_object_quaternions[index].round(9).tolist()),
                0.5,
            ),
        ]
    return ObservationLayout(fields)


def observe(
    geometry: SceneGeometry,
    joints: FloatArray,
    velocities: FloatArray,
    object_pose: FloatArray,
    object_size: FloatArray,
    steps: IntArray,
) -> FloatArray:
    """Return observations [N, D] in the order of `scene_layout`.

    Args:
        geometry: of the task.
        joints: [N, 2, 7] angles of both arms [rad].
        velocities: [N, 2, 7] [rad/s].
        object_pose: [N, 7 + h] centre [m] and quaternion in the world frame, and h joint positions [rad].
        object_size: [N, 3] edge lengths [m].
        steps: [N] the number of steps executed, 0 to T.
    """
    columns: list[FloatArray] = []
    relative: list[FloatArray] = []
    object_position, object_quaternion = object_pose[:, :3], object_pose[:, 3:7]
    for index, arm in enumerate(sawyer_pair()):
        position, rotation = arm.forward(joints[:, index])
        quaternion = same_hemisphere(matrix_to_quaternion(rotation), geometry.home_poses[1][index])
        columns += [joints[:, index], velocities[:, index], position, quaternion]
        inverse = quaternion_conjugate(quaternion)
        relative += [
            rotate(inverse, object_position - position),
            same_hemisphere(
                quaternion_product(inverse, object_quaternion), geometry.home_object_quaternions[index]
            ),
        ]
    timestep = np.eye(geometry.horizon + 1)[steps][:, : geometry.horizon]
    orientation = same_hemisphere(object_quaternion, IDENTITY)
    columns += [timestep, object_size, object_position, orientation, object_pose[:, 7:], *relative]
    return np.concatenate(columns, axis=1)
