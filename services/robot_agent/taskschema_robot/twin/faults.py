"""Faults on demand: what goes wrong with robots, networks and cameras."""

from enum import StrEnum


class FaultKind(StrEnum):
    """Every fault can be injected and, where it lasts, taken back."""

    DROP_CONNECTION = "drop-connection"
    """The robot's connections break without a close frame."""
    STALL_CONNECTION = "stall-connection"
    """Connections stay open, but nothing passes in either direction, not even answers to pings."""
    FREEZE_STATE = "freeze-state"
    """The robot's joint states stop coming."""
    SILENCE_WRENCH = "silence-wrench"
    """The robot's end-point states, the wrench in them, stop coming."""
    SILENCE_COLLISION = "silence-collision"
    """The robot's collision detection says nothing any more."""
    LOSE_ACKNOWLEDGEMENT = "lose-acknowledgement"
    """The gripper obeys but never says so."""
    PRESS_EMERGENCY_STOP = "press-emergency-stop"
    """Taken back, the button is released: the robot stays stopped."""
    STICK_GRIPPER = "stick-gripper"
    """The fingers stay where they are."""
    SKEW_CLOCK = "skew-clock"
    """The robot's clock is wrong by `value` seconds."""
    JOINT_ERROR = "joint-error"
    """A joint reports an error: the robot stops itself."""
    FREEZE_CAMERA = "freeze-camera"
    """The camera repeats its last picture."""
    REPEAT_PICTURE = "repeat-picture"
    """The camera goes on counting and stamping, but every picture is the same one."""
    OBSTACLE = "obstacle"
    """An upright bar, as thick as a person's arm, stands where a person would reach in."""
