"""What a robot's sensors would tell it of one simulated arm."""

from dataclasses import dataclass

from taskschema.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ArmMeasurement:
    """One arm at one moment."""

    positions: FloatArray
    """[7] joint angles [rad]."""
    velocities: FloatArray
    """[7] [rad/s]"""
    efforts: FloatArray
    """[7] torques of the servos [Nm]."""
    tool_position: FloatArray
    """[3] end effector in the robot's base frame [m]."""
    tool_quaternion: FloatArray
    """[4] its orientation there, w x y z."""
    wrench: FloatArray
    """[6] what the environment exerts on hand and fingers, in the base frame: force [N], torque about the end
    effector [Nm]."""
    finger_travel: float
    """Distance of the fingers from fully closed, together [m]."""
    finger_force: float
    """[N] between the pads."""
    contact_force: float
    """Largest force between a link of the arm and anything but what it handles [N]."""
