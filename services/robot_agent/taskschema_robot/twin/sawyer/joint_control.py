"""The robot's own joint controller: how commands become set-points of the servos."""

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.arm import ArmKinematics
from taskschema_robot.sawyer_interface import DEFAULT_COMMAND_TIMEOUT, DEFAULT_SPEED_RATIO

CLOSE_ENOUGH = 1e-6
"""[rad] to a goal: the arm is at rest on it."""


class JointControl:
    """Moves a reference towards what was commanded, within velocity and acceleration limits.

    As on the robot, a move in position mode goes on to its goal when commands cease, at a share of the
    joints' velocity limits; velocity mode falls back to holding the position when they do. Torque mode is not
    simulated: its commands have no effect.

    Args:
        arm: whose limits hold.
        joints: [7] where it stands [rad].

    """

    def __init__(self, arm: ArmKinematics, joints: FloatArray) -> None:
        self._arm = arm
        self.reference: FloatArray = joints.copy()
        """[7] set-point of the servos [rad]."""
        self.velocity: FloatArray = np.zeros(len(joints))
        """[7] of the set-point [rad/s]."""
        self.goal: FloatArray = joints.copy()
        """[7] in position mode [rad]."""
        self.speed_ratio = DEFAULT_SPEED_RATIO
        self.timeout = DEFAULT_COMMAND_TIMEOUT
        """After which velocity mode ends without commands [s]."""
        self._wanted: FloatArray | None = None
        self._commanded_at = float("-inf")

    def command_positions(self, joints: FloatArray) -> None:
        """Move to `joints` [7], or as far as the joint limits let it."""
        self._wanted = None
        self.goal = np.clip(joints, self._arm.lower, self._arm.upper)

    def command_velocities(self, velocities: FloatArray, now: float) -> None:
        """Move at `velocities` [7] until the time-out."""
        self._wanted = velocities
        self._commanded_at = now

    def halt(self) -> None:
        """Brake, and hold where that ends."""
        self._wanted = None
        braking = 0.5 * self.velocity * np.abs(self.velocity) / self._arm.acceleration
        self.goal = np.clip(self.reference + braking, self._arm.lower, self._arm.upper)

    def hold(self, joints: FloatArray) -> None:
        """Be at rest at `joints` [7]."""
        self._wanted = None
        self.reference, self.goal = joints.copy(), joints.copy()
        self.velocity = np.zeros(len(joints))

    def advance(self, seconds: float, now: float) -> None:
        """Move the reference on by one step."""
        acceleration = self._arm.acceleration
        if self._wanted is not None and now - self._commanded_at > self.timeout:
            self.halt()
        if self._wanted is not None:
            wanted = np.clip(self._wanted, -self._arm.velocity, self._arm.velocity)
        else:
            error = self.goal - self.reference
            distance = np.abs(error)
            if distance.max() < CLOSE_ENOUGH and np.abs(self.velocity).max() < CLOSE_ENOUGH:
                return
            # Slow down so that the goal is reached at rest; half a step less, because steps are finite.
            brake = acceleration * seconds
            speed = np.sqrt(0.25 * brake**2 + 2.0 * acceleration * distance) - 0.5 * brake
            speed = np.minimum(np.minimum(speed, self.speed_ratio * self._arm.velocity), distance / seconds)
            wanted = np.copysign(speed, error)
        most = acceleration * seconds
        self.velocity = self.velocity + np.minimum(np.maximum(wanted - self.velocity, -most), most)
        reference = self.reference + self.velocity * seconds
        self.reference = np.minimum(np.maximum(reference, self._arm.lower), self._arm.upper)
