"""Forward kinematics and Jacobian of one serial arm, in batches."""

import copy
from dataclasses import dataclass
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
        moved = copy.copy(self)
        # What follows from the chain alone is the same, and not computed again.
        moved.__dict__.update(
            base_position=position, base_rotation=rotation, _axes=self._axes, _tool=self._tool
        )
        return moved

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
        """X and y axes [4, J, 1] of the joints' frames in the ones before; the rest of these [J, 1, 4, 4]."""
        x, y = (np.zeros((4, self.joint_count, 1)) for _ in range(2))
        x[:3, :, 0], y[:3, :, 0] = self.rotations[:, :, 0].T, self.rotations[:, :, 1].T
        fixed = np.zeros((self.joint_count, 1, 4, 4))
        fixed[:, 0, :3, 2], fixed[:, 0, :3, 3] = self.rotations[:, :, 2], self.positions
        fixed[:, 0, 3, 3] = 1.0
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
        cosine, sine = np.ascontiguousarray(np.cos(angles).T), np.ascontiguousarray(np.sin(angles).T)
        x, y, fixed = self._axes
        local = np.empty((self.joint_count, len(angles), 4, 4))
        local[:] = fixed
        local[..., 0] = np.moveaxis(x * cosine + y * sine, 0, 2)
        local[..., 1] = np.moveaxis(y * cosine - x * sine, 0, 2)
        frames = np.empty((self.joint_count + 1, len(angles), 4, 4))
        frames[0] = local[0]
        for joint in range(1, self.joint_count):
            np.matmul(frames[joint - 1], local[joint], out=frames[joint])
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
        # The batch comes last, where NumPy runs fastest: z axes and origins of the joints' frames [3, J, N].
        axes, origins = np.ascontiguousarray(frames[:-1, :, :3, 2:].transpose(3, 2, 0, 1))
        ax, ay, az = axes
        rx, ry, rz = end[:, :3, 3].T[:, None] - origins
        jacobian = np.stack([ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx, ax, ay, az])
        return end[:, :3, 3], end[:, :3, :3], np.ascontiguousarray(np.moveaxis(jacobian, 2, 0))
