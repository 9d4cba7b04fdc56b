"""Errors of the robot agent; every message is one line and says what to do."""

from taskschema.errors import TaskschemaError


class RobotError(TaskschemaError):
    """Base of what can go wrong between the agent and a robot."""


class NotConnectedError(RobotError):
    """No connection, or one that does not answer: nothing was sent, and nothing is kept to be sent later."""


class StaleStateError(RobotError):
    """The robot's state is too old to move on."""


class NotReadyError(RobotError):
    """The arm is not enabled, stopped, in error, or its gripper is not calibrated."""


class SetpointError(RobotError):
    """A set-point that is not finite, outside the joint limits, or farther away than a stop would take."""


class EffectTimeoutError(RobotError):
    """A command whose effect the robot's state did not show in time."""


class CameraError(RobotError):
    """A camera that cannot be opened or has no picture."""


class TwinError(RobotError):
    """A twin that cannot be started, reached, or asked for this."""
