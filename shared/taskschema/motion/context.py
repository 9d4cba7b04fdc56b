"""What a skill knows when its step starts."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.arm import ArmKinematics
from taskschema.kinematics.sawyer import Gripper


@dataclass(frozen=True, eq=False)
class PlanningContext:
    """One arm's state and the object's, for N episodes, in the world frame."""

    arm: ArmKinematics
    """The arm, where it stands in the world."""
    gripper: Gripper
    """Its gripper's geometry."""
    joints: FloatArray
    """[N, 7] joint angles to start from [rad]: measured, or the set-point where the arm may be pressing."""
    opening: FloatArray
    """[N] gripper set-point: opening between the pads [m]."""
    object_position: FloatArray
    """[N, 3] the object's centre [m]; the table's top is at z = 0."""
    object_quaternion: FloatArray
    """[N, 4] the object's orientation, w x y z."""
    object_size: FloatArray
    """[N, 3] the object's edge lengths in its own frame [m]."""
    top_grasp_offset: FloatArray
    """[N] from the object's centre along its z axis to where a grasp from above takes it [m]."""
    side_grasp_offset: FloatArray
    """[N] the same for a grasp from the side [m]."""
    lift_speed: float
    """[m/s] at which both arms rise, whatever their distances: what they hold stays level."""

    @property
    def top_grasp_height(self) -> FloatArray:
        """[N] world height at which a grasp from above takes the object [m]."""
        return self._height(self.top_grasp_offset)

    @property
    def side_grasp_height(self) -> FloatArray:
        """[N] world height at which a grasp from the side takes the object [m]."""
        return self._height(self.side_grasp_offset)

    def _height(self, offset: FloatArray) -> FloatArray:
        """Return the world height [N] of points `offset` [N] along the object's z axis."""
        x, y = self.object_quaternion[:, 1], self.object_quaternion[:, 2]
        upright = 1 - 2 * (x * x + y * y)
        return np.asarray(self.object_position[:, 2] + offset * upright)
