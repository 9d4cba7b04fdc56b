"""What stops both arms, and how it reaches whoever was moving them."""

from dataclasses import dataclass
from enum import StrEnum

from taskschema_robot.errors import RobotError


class FaultKind(StrEnum):
    """What was wrong."""

    CONNECTION = "connection"
    STATE_AGE = "state_age"
    TRACKING = "tracking"
    """A joint is not where it was sent."""
    WRENCH = "wrench"
    COLLISION = "collision"
    """The robot's own collision detection."""
    NOT_ENABLED = "not_enabled"
    STOPPED = "stopped"
    EMERGENCY_STOP = "emergency_stop"
    ROBOT_ERROR = "robot_error"
    COMMAND = "command"
    """A driver did not take a command."""
    LATE = "late"
    """The agent itself could not keep the rate of its set-points."""
    AGENT = "agent"
    """The agent itself failed during a motion: an error that it has no words for, or it was ended."""
    ARRIVAL = "arrival"
    GRIPPER = "gripper"
    CAMERA = "camera"
    LINK = "link"
    """Redis or the learner is gone."""
    REQUESTED = "requested"
    """A person stopped it: stop key, stop endpoint, or hold-to-run released."""


@dataclass(frozen=True)
class Fault:
    """Why both arms were stopped; it stays until a person acknowledges it."""

    kind: FaultKind
    reason: str
    """One line for a person."""
    time: float
    """On the agent's clock [s]."""


class FaultError(RobotError):
    """A motion was broken off, or not begun, because of a fault that is not acknowledged yet."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(f"Both arms are stopped: {fault.reason}. Look at the robots, then acknowledge.")
        self.fault = fault


class RecoveryError(RobotError):
    """The arms cannot get back to their home pose by themselves."""
