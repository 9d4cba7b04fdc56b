"""Forward kinematics and Jacobian of one serial arm, in batches."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from taskschema.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class ArmKinematics:
    """A chain of J revolute joints, each turning about its own frame's z axis, and a tool at its end.

    Arms of one kind that stand in different places can be one batch: each of its rows then has its own base.
    The rows of a batch never mix: a row's result has the same bits in any batch.
    """

    base_position: FloatArray
    """[3], or [N, 3] for a batch of N rows: base in the world frame [m]."""
    base_rotation: FloatArray
    """[3, 3] or [N, 3, 3]: base in the world frame."""
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

    def rows(self, chosen: IntArray) -> "ArmKinematics":
        """Return the arm for the chosen rows of a batch only."""
        if self.base_position.ndim == 1:
            return self
        return self.at(self.base_position[chosen], self.base_rotation[chosen])

    @cached_property
    def joint_count(self) -> int:
        """J."""
        return len(self.positions)

    @cached_property
    def _axes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """X and y axes [J, 4] of the joints' frames in the ones before, and what does not turn [J, 4, 4]."""
        x, y = (
            np.concatenate([self.rotations[:, :, axis], np.zeros((self.joint_count, 1))], axis=1)
            for axis in (0, 1)
        )
        fixed = np.zeros((self.joint_count, 4, 4))
        fixed[:, :3, 2], fixed[:, :3, 3], fixed[:, 3, 3] = self.rotations[:, :, 2], self.positions, 1.0
        return x, y, fixed

    @cached_property
    def _tool(self) -> FloatArray:
        """The tool in the last joint's frame, homogeneous [4, 4]."""
        tool = np.eye(4)
        tool[:3, :3], tool[:3, 3] = self.tool_rotation, self.tool_position
        return tool

    def _frames(self, joints: FloatArray) -> FloatArray:
        """Return the joint frames, then the end effector's, in the base: homogeneous [J + 1, N, 4, 4].

        Stacked products run matrix by matrix, so that the batch size does not enter.
        """
        # Trigonometry runs on one contiguous array: strided and contiguous loops may differ in the last bit.
        angles = np.ascontiguousarray(joints, dtype=np.float64)
        cosine, sine = np.cos(angles)[:, :, None], np.sin(angles)[:, :, None]
        x, y, fixed = self._axes
        local = np.empty((len(angles), self.joint_count, 4, 4))
        local[:] = fixed
        local[..., 0] = x * cosine + y * sine
        local[..., 1] = y * cosine - x * sine
        frames = np.empty((self.joint_count + 1, len(angles), 4, 4))
        frames[0] = local[:, 0]
        for joint in range(1, self.joint_count):
            np.matmul(frames[joint - 1], local[:, joint], out=frames[joint])
        np.matmul(frames[-2], self._tool, out=frames[-1])
        return frames

    def forward(self, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the end effector's position [N, 3] in metres and rotation [N, 3, 3] in the world frame."""
        end = self._frames(joints)[-1]
        position = (self.base_rotation @ end[:, :3, 3:])[:, :, 0] + self.base_position
        return position, self.base_rotation @ end[:, :3, :3]

    def in_base(self, position: FloatArray, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions [N, 3] and rotations [N, 3, 3] given in the world frame in the base's."""
        back = np.swapaxes(self.base_rotation, -1, -2)
        return (back @ (position - self.base_position)[:, :, None])[:, :, 0], back @ rotation

    def forward_and_jacobian(self, joints: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position [N, 3], rotation [N, 3, 3] and Jacobian [N, 6, J] in the base's frame.

        The Jacobian's first rows are linear, then angular.
        """
        frames = self._frames(joints)
        end = frames[-1]
        axes, origins = frames[:-1, :, :3, 2], frames[:-1, :, :3, 3]
        ax, ay, az = axes[..., 0].T, axes[..., 1].T, axes[..., 2].T
        arms = end[:, :3, 3] - origins
        rx, ry, rz = arms[..., 0].T, arms[..., 1].T, arms[..., 2].T
        jacobian = np.empty((len(end), 6, self.joint_count))
        jacobian[:, 0] = ay * rz - az * ry
        jacobian[:, 1] = az * rx - ax * rz
        jacobian[:, 2] = ax * ry - ay * rx
        jacobian[:, 3], jacobian[:, 4], jacobian[:, 5] = ax, ay, az
        return end[:, :3, 3], end[:, :3, :3], jacobian
