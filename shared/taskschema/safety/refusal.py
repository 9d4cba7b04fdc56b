"""Why the gate refuses a motion."""

from dataclasses import dataclass
from enum import StrEnum

from taskschema.arrays import FloatArray


class RefusalKind(StrEnum):
    """Which check a motion did not pass."""

    MALFORMED = "malformed"
    """Wrong shapes or numbers that are not finite."""
    TOO_LONG = "too_long"
    START = "start"
    """It does not start where the arms are."""
    JOINT_LIMIT = "joint_limit"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"
    GRIPPER = "gripper"
    """An opening that the gripper does not have."""
    INVERSE_KINEMATICS = "inverse_kinematics"
    """It does not end where it was meant to."""
    WORKSPACE = "workspace"
    ARMS_COLLIDE = "arms_collide"
    SELF_COLLISION = "self_collision"
    TABLE = "table"
    HELD_OBJECT = "held_object"
    """What a hand holds comes too near to a link or the table."""


@dataclass(frozen=True, eq=False)
class Refusal:
    """A motion that the gate did not let through: a normal outcome, never clipped into another motion."""

    kind: RefusalKind
    reason: str
    """One line for a person."""
    time: float | None = None
    """When in the motion it happens [s]."""
    configuration: FloatArray | None = None
    """[2, 7] joint angles then [rad], for a picture."""
    bodies: tuple[str, ...] = ()
    """The shapes that come too near."""
