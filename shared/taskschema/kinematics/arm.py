"""Forward kinematics and Jacobian of one serial arm, in batches."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from taskschema.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ArmKinematics:
    """A chain of J revolute joints, each turning about its own frame's z axis, and a tool at its end.

    The rows of a batch never mix: a row's result has the same bits in any batch.
    """

    base_position: FloatArray
    """[3] base in the world frame [m]."""
    base_rotation: FloatArray
    """[3, 3] base in the world frame."""
    positions: FloatArray
    """[J, 3] each joint's frame in the one before it [m]."""
    rotations: FloatArray
    """[J, 3, 3] each joint's frame in the one before it, at angle 0."""
    tool_position: FloatArray
    """[3] end effector, the point between the finger pads, in the last joint's frame [m]."""
    tool_rotation: FloatArray
    """[3, 3] end effector in the last joint's frame; z points out along the fingers, which close along x."""
    lower: FloatArray
    """[J] lower joint limits [rad]."""
    upper: FloatArray
    """[J] upper joint limits [rad]."""
    velocity: FloatArray
    """[J] velocity limits [rad/s]."""
    acceleration: FloatArray
    """[J] acceleration limits [rad/s^2]."""

    def at(self, position: FloatArray, rotation: FloatArray) -> "ArmKinematics":
        """Return the same arm with its base elsewhere."""
        return replace(self, base_position=position, base_rotation=rotation)

    @cached_property
    def joint_count(self) -> int:
        """J."""
        return len(self.positions)

    def _frames(self, joints: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return origins [N, 3] and rotations [N, 3, 3] of the joint frames, then of the end effector."""
        # Trigonometry runs on one contiguous array: strided and contiguous loops may differ in the last bit.
        angles = np.ascontiguousarray(joints, dtype=np.float64)
        cosine, sine = np.cos(angles)[:, :, None], np.sin(angles)[:, :, None]
        count = len(angles)
        position = np.broadcast_to(self.base_position, (count, 3))
        rotation = np.broadcast_to(self.base_rotation, (count, 3, 3))
        origins, turned = [], []
        for joint in range(self.joint_count):
            position = position + _transform(rotation, self.positions[joint])
            fixed = _compose(rotation, self.rotations[joint])
            x, y = fixed[:, :, 0], fixed[:, :, 1]
            rotation = np.empty((count, 3, 3))
            rotation[:, :, 0] = x * cosine[:, joint] + y * sine[:, joint]
            rotation[:, :, 1] = y * cosine[:, joint] - x * sine[:, joint]
            rotation[:, :, 2] = fixed[:, :, 2]
            origins.append(position)
            turned.append(rotation)
        origins.append(position + _transform(rotation, self.tool_position))
        turned.append(_compose(rotation, self.tool_rotation))
        return origins, turned

    def forward(self, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the end effector's position [N, 3] in metres and rotation [N, 3, 3] in the world frame."""
        origins, rotations = self._frames(joints)
        return origins[-1], rotations[-1]

    def forward_and_jacobian(self, joints: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position [N, 3], rotation [N, 3, 3] and Jacobian [N, 6, J]: linear rows, then angular."""
        origins, rotations = self._frames(joints)
        axes = np.stack([rotation[:, :, 2] for rotation in rotations[:-1]], axis=1)
        arms = origins[-1][:, None, :] - np.stack(origins[:-1], axis=1)
        jacobian = np.empty((len(axes), 6, self.joint_count))
        ax, ay, az = axes[..., 0], axes[..., 1], axes[..., 2]
        rx, ry, rz = arms[..., 0], arms[..., 1], arms[..., 2]
        jacobian[:, 0] = ay * rz - az * ry
        jacobian[:, 1] = az * rx - ax * rz
        jacobian[:, 2] = ax * ry - ay * rx
        jacobian[:, 3], jacobian[:, 4], jacobian[:, 5] = ax, ay, az
        return origins[-1], rotations[-1], jacobian


def _transform(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    """Apply [N, 3, 3] to one vector [3]: written out, so that the order of the sum is fixed."""
    return np.asarray(
        rotation[:, :, 0] * vector[0] + rotation[:, :, 1] * vector[1] + rotation[:, :, 2] * vector[2]
    )


def _compose(rotation: FloatArray, fixed: FloatArray) -> FloatArray:
    """Return [N, 3, 3] times one matrix [3, 3]."""
    return np.stack([_transform(rotation, fixed[:, column]) for column in range(3)], axis=2)
