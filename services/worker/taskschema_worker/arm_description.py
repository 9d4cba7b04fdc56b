"""What the simulated Sawyer has that robosuite's model has not: limits, servos and simple collision shapes.

Velocity and acceleration limits are those of the vendor's joint limit description. Capsules were fitted by
hand to the extents of the visual meshes, in each link's frame [m].
"""

from dataclasses import dataclass

VELOCITY_LIMITS = (1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545)
"""[rad/s], joint 0 to 6."""
ACCELERATION_LIMITS = (10.0, 8.0, 10.0, 10.0, 12.0, 12.0, 12.0)
"""[rad/s^2], joint 0 to 6."""


@dataclass(frozen=True)
class JointServo:
    """Position servo of one joint: torque = stiffness (command - angle) - velocity_gain velocity."""

    stiffness: float
    """[Nm/rad]"""
    velocity_gain: float
    """[Nm s/rad]"""
    effort: float
    """Largest torque, gravity compensation included [Nm]."""
    armature: float
    """Reflected rotor inertia [kg m^2]."""
    damping: float
    """Friction in the joint itself [Nm s/rad]."""


JOINT_SERVOS = (
    JointServo(1200.0, 120.0, 80.0, 0.3, 0.5),
    JointServo(1200.0, 120.0, 80.0, 0.3, 0.5),
    JointServo(1000.0, 100.0, 40.0, 0.2, 0.5),
    JointServo(1000.0, 100.0, 40.0, 0.2, 0.5),
    JointServo(400.0, 20.0, 9.0, 0.05, 0.2),
    JointServo(400.0, 20.0, 9.0, 0.05, 0.2),
    JointServo(400.0, 20.0, 9.0, 0.05, 0.1),
)

Point = tuple[float, float, float]

Capsule = tuple[Point, Point, float]

CAPSULES: dict[str, tuple[Capsule, ...]] = {
    "base": (((0.0, 0.0, 0.0), (0.02, 0.0, 0.24), 0.085),),
    "right_l1": (((0.0, 0.0, 0.04), (0.0, -0.07, 0.13), 0.068),),
    "right_l2": (((0.0, 0.0, 0.05), (0.0, 0.0, 0.26), 0.054),),
    "right_l3": (((0.0, 0.0, -0.05), (0.0, -0.07, -0.12), 0.054),),
    "right_l4": (((0.0, 0.0, 0.04), (0.0, 0.0, 0.273), 0.047),),
    "right_l5": (((0.0, 0.0, 0.045), (0.0, 0.0, 0.105), 0.049),),
    "right_l6": (((0.0, 0.0, -0.02), (0.0, 0.0, 0.0), 0.042),),
    "gripper_base": (((0.0, 0.0, 0.0), (0.0, 0.0, 0.04), 0.03),),
}
"""Start, end and radius of each link's capsules."""

FINGER_CAPSULES: dict[str, Capsule] = {
    "l_finger": ((0.0, 0.01255, 0.0415), (0.0, 0.01255, 0.0745), 0.004),
    "r_finger": ((0.0, -0.01255, 0.0415), (0.0, -0.01255, 0.0745), 0.004),
}
"""The round pads: as deep as the model's finger tips, with their inner faces where its pads are."""
