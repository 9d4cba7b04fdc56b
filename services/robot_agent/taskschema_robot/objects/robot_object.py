"""One household object: its size, its markers, how it is put back, and what the twin simulates."""

from dataclasses import dataclass

from taskschema.errors import ConfigError
from taskschema_robot.objects.marker import Marker


@dataclass(frozen=True)
class Part:
    """One primitive shape of the twin's model, in its link's frame."""

    shape: str
    """MuJoCo's geom type: `box`, `cylinder`, `capsule` or `sphere`."""
    size: tuple[float, ...]
    """Half edges, or radius and half length [m]."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """[m]"""
    euler: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """[rad]"""
    density: float = 1000.0
    """[kg/m^3]"""
    friction: float = 0.9
    """Coefficient of sliding friction against pads and table."""
    rolling: float = 0.0
    """How far ahead of its centre it is supported while it rolls [m]: a soft ball comes to rest."""
    colour: tuple[float, float, float] = (0.6, 0.6, 0.6)


@dataclass(frozen=True)
class RobotObject:
    """An object of the real experiments. Frames: origin at the bounding box's centre, z up as it stands."""

    name: str
    """On the command line, for example `rolling-pin`."""
    family: str
    """Task family (paper, Table I)."""
    size: tuple[float, float, float]
    """Edge lengths of its bounding box as it stands [m]."""
    mass: float
    """[kg]"""
    markers: tuple[Marker, ...]
    """On the object's root link."""
    reset: tuple[str, ...]
    """What a person does before an episode, step by step."""
    parts: tuple[Part, ...]
    """Of the twin's root link."""
    joint_markers: tuple[Marker, ...] = ()
    """On the link that turns against the root about the vertical, in its frame at angle 0."""
    joint_parts: tuple[Part, ...] = ()
    """Of the twin's turning link."""
    joint_friction: float = 0.0
    """Torque that the hinge resists with [Nm]."""
    yaw: float = 0.0
    """Usual angle of its x axis to the world's at the start [rad]."""
    faces: bool = False
    """Whether `reset` says how it is to be turned, which is `yaw`: it is then looked at."""
    location_range: tuple[float, float] = (0.06, 0.06)
    """A person puts it anywhere within +- these distances of the table's centre along x and y [m]."""

    def __post_init__(self) -> None:
        numbers = [marker.number for marker in (*self.markers, *self.joint_markers)]
        if len(set(numbers)) != len(numbers):
            raise ConfigError(f"Object {self.name!r}: two markers have the same number.")
        if bool(self.joint_markers) != bool(self.joint_parts):
            raise ConfigError(f"Object {self.name!r}: a turning link needs markers and parts, or neither.")

    @property
    def mjcf(self) -> str:
        """The twin's model: body `object` with a free joint, and the turning link on a joint `hinge`."""
        inner = ""
        if self.joint_parts:
            inner = (
                f'<body name="turning"><joint name="hinge" axis="0 0 1" frictionloss="{self.joint_friction}" '
                f'damping="0.002"/>{_geoms(self.joint_parts)}</body>'
            )
        return (
            '<mujoco><compiler angle="radian"/><option cone="elliptic" impratio="10"/>'
            f'<worldbody><body name="object"><freejoint name="object"/>'
            f"{_geoms(self.parts)}{inner}</body></worldbody></mujoco>"
        )


def _geoms(parts: tuple[Part, ...]) -> str:
    return "".join(
        f'<geom type="{part.shape}" size="{_numbers(part.size)}" pos="{_numbers(part.position)}" '
        f'euler="{_numbers(part.euler)}" density="{part.density:g}" '
        f'friction="{part.friction:g} 0.005 {max(part.rolling, 0.0001):g}" '
        f'condim="{6 if part.rolling else 3}" rgba="{_numbers(part.colour)} 1"/>'
        for part in parts
    )


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:g}" for value in values)
