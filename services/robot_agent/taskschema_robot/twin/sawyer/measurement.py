"""What a robot's sensors would tell it of one simulated arm."""

from dataclasses import dataclass

import mujoco
import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.arm import ArmKinematics


@dataclass(frozen=True, eq=False)
class ArmMeasurement:
    """One arm at one moment; what its robot says in its own base frame is worked out when it is asked for."""

    arm: ArmKinematics
    """Where its base stands."""
    positions: FloatArray
    """[7] joint angles [rad]."""
    velocities: FloatArray
    """[7] [rad/s]"""
    efforts: FloatArray
    """[7] torques of the servos [Nm]."""
    tool: FloatArray
    """[3] end effector in the world [m]."""
    tool_frame: FloatArray
    """[9] its orientation there: a rotation matrix, row by row."""
    push: FloatArray
    """[6] what the environment exerts on hand and fingers, in the world: force [N], torque about the end
    effector [Nm]."""
    finger_travel: float
    """Distance of the fingers from fully closed, together [m]."""
    finger_force: float
    """[N] between the pads."""
    contact_force: float
    """Largest force between a link of the arm and anything but what it handles [N]."""

    @property
    def tool_position(self) -> FloatArray:
        """[3] end effector in the robot's base frame [m]."""
        return self.arm.base_rotation.T @ (self.tool - self.arm.base_position)

    @property
    def tool_quaternion(self) -> FloatArray:
        """[4] its orientation there, w x y z."""
        rotation = self.arm.base_rotation.T @ self.tool_frame.reshape(3, 3)
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, rotation.ravel())
        return quaternion

    @property
    def wrench(self) -> FloatArray:
        """[6] `push` in the base frame."""
        return (self.push.reshape(2, 3) @ self.arm.base_rotation).ravel()
