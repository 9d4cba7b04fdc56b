"""What a client asks of the twin itself, beside what it tells the robots: time, objects, faults, pictures."""

import msgspec

from taskschema_robot.twin.faults import FaultKind


class Describe(msgspec.Struct, tag="describe", frozen=True, forbid_unknown_fields=True):
    """Ask what this twin is."""


class Advance(msgspec.Struct, tag="advance", frozen=True, forbid_unknown_fields=True):
    """Ask for simulated time, in lock-step."""

    until: float
    """What the clock shall show [s since the epoch]."""
    sent: dict[str, int]
    """How many frames each of the client's connections to the robots, by path, has sent: they come first."""


class PlaceObject(msgspec.Struct, tag="place-object", frozen=True, forbid_unknown_fields=True):
    """Put the object somewhere, as a person does between episodes."""

    pose: list[float]
    """Position [m], quaternion w x y z, and the positions of its joints."""


class WhereIsObject(msgspec.Struct, tag="where-is-object", frozen=True, forbid_unknown_fields=True):
    """Ask where the object really is: for tests, and for observations while there are no pictures."""


class Inject(msgspec.Struct, tag="inject", frozen=True, forbid_unknown_fields=True):
    """Cause a fault, or take it back."""

    kind: FaultKind
    arm: int | None = None
    """0 left, 1 right; None: both, or no robot's fault."""
    active: bool = True
    value: float = 0.0


class TakePicture(msgspec.Struct, tag="take-picture", frozen=True, forbid_unknown_fields=True):
    """Ask for a picture; the pixels follow the answer in a binary frame."""


Request = Describe | Advance | PlaceObject | WhereIsObject | Inject | TakePicture


class Description(msgspec.Struct, tag="description", frozen=True):
    """What this twin is."""

    name: str
    """Of its object."""
    urls: tuple[str, str]
    """Of the robots' bridges, left arm first."""
    real_time: bool
    time: float
    """[s since the epoch]"""


class Advanced(msgspec.Struct, tag="advanced", frozen=True):
    """Time has passed."""

    time: float
    """What the clock shows [s since the epoch]."""
    sent: dict[str, int]
    """How many frames each of the client's connections, by path, has been sent; none for one that is gone."""
    picture_time: float
    """When the camera's newest picture was taken [s since the epoch]."""
    picture_number: int
    """Of that picture."""
    picture_digest: int
    """Of what is to be seen on it."""


class ObjectPose(msgspec.Struct, tag="object-pose", frozen=True):
    """Where the object is."""

    pose: list[float]
    """Position [m], quaternion w x y z, and the positions of its joints."""


class PictureTaken(msgspec.Struct, tag="picture-taken", frozen=True):
    """A picture, whose pixels follow: red, green, blue, row by row."""

    time: float
    number: int
    digest: int
    height: int
    width: int


class Done(msgspec.Struct, tag="done", frozen=True):
    """It has been done."""


class Refused(msgspec.Struct, tag="refused", frozen=True):
    """It cannot be done."""

    reason: str


Answer = Description | Advanced | ObjectPose | PictureTaken | Done | Refused
