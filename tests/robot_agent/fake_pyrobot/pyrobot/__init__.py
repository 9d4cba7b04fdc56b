"""Stands in for PyRobot in a process without ROS: published signatures, a perfect arm behind them."""

import os
import time

from simulated_sawyer import SAWYER, checked

SLOW = float(os.environ.get("TASKSCHEMA_SLOW_SETPOINT", "0"))


class Arm:
    @checked("Arm.get_joint_angles")
    def get_joint_angles(self):
        return SAWYER.positions

    @checked("Arm.get_joint_velocities")
    def get_joint_velocities(self):
        return [0.0] * 7

    @checked("Arm.get_joint_torques")
    def get_joint_torques(self):
        return [0.0] * 7

    @checked("Arm.get_collision_state")
    def get_collision_state(self):
        return False

    @checked("Arm.set_joint_positions")
    def set_joint_positions(self, positions, plan=True, wait=True, **kwargs):
        assert not plan
        assert not wait
        time.sleep(SLOW)
        if SAWYER.enabled:
            SAWYER.positions = list(positions)


class Gripper:
    def __init__(self):
        from intera_interface import Gripper as Fingers

        self.gripper = Fingers()

    @checked("Gripper.open")
    def open(self, position=None, wait=True):
        assert not wait
        SAWYER.travel = position


class Robot:
    @checked("pyrobot.Robot")
    def __init__(
        self,
        robot_name,
        use_arm=True,
        use_base=True,
        use_camera=True,
        use_gripper=True,
        arm_config={},  # noqa: B006 - as published
        base_config={},  # noqa: B006
        camera_config={},  # noqa: B006
        gripper_config={},  # noqa: B006
        common_config={},  # noqa: B006
    ):
        assert robot_name == "sawyer"
        assert not use_base
        assert not use_camera
        print("noise on standard output, as libraries make it")
        self.arm, self.gripper = Arm(), Gripper()
