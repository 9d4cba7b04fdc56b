"""Stands in for the vendor's SDK."""

from simulated_sawyer import SAWYER, checked


class Gripper:
    @checked("intera_interface.Gripper.calibrate")
    def calibrate(self):
        SAWYER.calibrated = True

    @checked("intera_interface.Gripper.is_calibrated")
    def is_calibrated(self):
        return SAWYER.calibrated

    @checked("intera_interface.Gripper.is_moving")
    def is_moving(self):
        return False

    @checked("intera_interface.Gripper.is_gripping")
    def is_gripping(self):
        return False

    @checked("intera_interface.Gripper.has_error")
    def has_error(self):
        return False

    @checked("intera_interface.Gripper.get_position")
    def get_position(self):
        return SAWYER.travel


class RobotEnable:
    @checked("intera_interface.RobotEnable")
    def __init__(self, versioned=False):
        pass

    @checked("intera_interface.RobotEnable.state")
    def state(self):
        return SAWYER

    @checked("intera_interface.RobotEnable.enable")
    def enable(self):
        SAWYER.enabled = True

    @checked("intera_interface.RobotEnable.disable")
    def disable(self):
        SAWYER.enabled = False

    @checked("intera_interface.RobotEnable.reset")
    def reset(self):
        SAWYER.stopped = SAWYER.enabled = False

    @checked("intera_interface.RobotEnable.stop")
    def stop(self):
        SAWYER.stopped, SAWYER.enabled = True, False


class Limb:
    @checked("intera_interface.Limb")
    def __init__(self, limb="right", synchronous_pub=False):
        pass

    @checked("intera_interface.Limb.set_joint_position_speed")
    def set_joint_position_speed(self, speed=0.3):
        assert 0.0 <= speed <= 1.0

    @checked("intera_interface.Limb.endpoint_effort")
    def endpoint_effort(self):
        return {"force": (0.0, 0.0, -9.0), "torque": (0.0, 0.0, 0.0)}
