"""The nine objects of Table I, whose dimensions the paper does not give.

These are such that both hands can act on them within the search spaces and clear of each other: an expert
solves each on the twin, see `studies.twin_expert`.

Measure yours, and change its entry: the gate sweeps what the hands hold by these sizes, and the reward
computes poses from where the markers sit.
"""

import numpy as np

from taskschema.errors import UnknownNameError
from taskschema_robot.objects.marker import Marker
from taskschema_robot.objects.robot_object import Part, RobotObject

WOOD, STEEL, GLASS, PLASTIC = (0.72, 0.53, 0.35), (0.55, 0.57, 0.6), (0.5, 0.7, 0.65), (0.25, 0.4, 0.7)
DIAGONAL = np.pi / 4
ROOT = float(np.sqrt(0.5))
HANDLE = float(np.deg2rad(70.0))
"""Angle of a T-handle to its object's x axis at the start [rad], as the task's corkscrew has it."""


def _on_top(number: int, size: float, x: float, y: float, z: float) -> Marker:
    return Marker(number, size, (x, y, z))


def _along(number: int, size: float, along: float, z: float) -> Marker:
    """Return a marker on a T-handle, so far from its middle towards the right robot."""
    return _on_top(number, size, along * float(np.cos(HANDLE)), along * float(np.sin(HANDLE)), z)


def _t_base(height: float, colour: tuple[float, float, float]) -> tuple[Part, ...]:
    """Return foot and body of something that stands `height` tall [m] and has a T-handle."""
    bottom, half = -0.5 * height, 0.5 * height - 0.02
    return (
        Part("cylinder", (0.045, 0.005), (0.0, 0.0, bottom + 0.005), friction=0.25, colour=colour),
        Part("capsule", (0.014, half - 0.014), (0.0, 0.0, bottom + 0.01 + half), friction=1.2, colour=colour),
    )


def _t_handle(height: float, length: float, colour: tuple[float, float, float]) -> tuple[Part, ...]:
    """Return its T-handle at angle 0: nearly along the line between the robots."""
    turn = (-np.pi / 2, np.pi / 2 - HANDLE, 0.0)
    level = 0.5 * height - 0.01
    return (
        Part("capsule", (0.008, 0.012), (0.0, 0.0, level - 0.012), friction=0.3, colour=colour),
        Part("capsule", (0.01, 0.5 * length - 0.01), (0.0, 0.0, level), turn, friction=0.3, colour=colour),
    )


ALUMINIUM_TRAY = RobotObject(
    name="aluminium-tray",
    family="lateral_lifting",
    size=(0.30, 0.22, 0.065),
    mass=1.0,
    markers=(_on_top(0, 0.06, -0.1, 0.0, -0.012), _on_top(1, 0.06, 0.1, 0.0, -0.012)),
    reset=(
        "Put the tray flat on the table, a handle towards each robot.",
        "Turn it so that marker 0 lies on the left robot's left.",
    ),
    parts=(
        Part("box", (0.15, 0.11, 0.01), (0.0, 0.0, -0.0225), density=600, colour=STEEL),
        Part("box", (0.08, 0.008, 0.0225), (0.0, 0.085, 0.01), density=1000, friction=1.05, colour=STEEL),
        Part("box", (0.08, 0.008, 0.0225), (0.0, -0.085, 0.01), density=1000, friction=1.05, colour=STEEL),
    ),
    faces=True,
)
ROLLING_PIN = RobotObject(
    name="rolling-pin",
    family="lateral_lifting",
    size=(0.44, 0.05, 0.05),
    mass=0.6,
    markers=(_on_top(2, 0.03, -0.17, 0.0, 0.026), _on_top(3, 0.03, 0.17, 0.0, 0.026)),
    reset=(
        "Lay the rolling pin between the robots, diagonally, its flats with the markers up.",
        "Turn it so that marker 2 lies towards the left robot's left.",
    ),
    parts=(
        Part("capsule", (0.025, 0.1), euler=(0.0, np.pi / 2, 0.0), density=700, friction=1.0, colour=WOOD),
        Part("capsule", (0.014, 0.2), euler=(0.0, np.pi / 2, 0.0), density=1200, friction=1.0, colour=WOOD),
    ),
    yaw=DIAGONAL,
    faces=True,
)
HEAVY_BAR = RobotObject(
    name="heavy-bar",
    family="lateral_lifting",
    size=(0.9, 0.016, 0.045),
    mass=4.8,
    markers=(
        _on_top(4, 0.06, -0.4, 0.0, 0.025),
        _on_top(5, 0.06, 0.4, 0.0, 0.025),
    ),
    reset=("Lay the bar on its narrow side, diagonally, marker 4 towards the left robot's left.",),
    parts=(Part("box", (0.45, 0.008, 0.0225), density=7400, friction=1.05, colour=STEEL),),
    yaw=DIAGONAL,
    location_range=(0.08, 0.08),
    faces=True,
)
PLASTIC_BOX = RobotObject(
    name="plastic-box",
    family="lateral_lifting",
    size=(0.34, 0.22, 0.12),
    mass=1.4,
    markers=(_on_top(6, 0.06, -0.12, 0.0, -0.039), _on_top(7, 0.06, 0.12, 0.0, -0.039)),
    reset=("Put the box, open, with a long side towards each robot, marker 6 on the left robot's left.",),
    parts=(
        Part("box", (0.17, 0.094, 0.01), (0.0, 0.0, -0.05), density=550, colour=PLASTIC),
        Part("box", (0.17, 0.008, 0.06), (0.0, 0.102, 0.0), density=550, friction=1.05, colour=PLASTIC),
        Part("box", (0.17, 0.008, 0.06), (0.0, -0.102, 0.0), density=550, friction=1.05, colour=PLASTIC),
    ),
    faces=True,
)
SOCCER_BALL = RobotObject(
    name="soccer-ball",
    family="picking",
    size=(0.15, 0.15, 0.15),
    mass=0.2,
    markers=(
        _on_top(8, 0.04, 0.0, 0.0, 0.077),
        Marker(9, 0.04, (0.0545, 0.0, 0.0545), (ROOT, 0.0, -ROOT)),
        Marker(10, 0.04, (-0.0545, 0.0, 0.0545), (ROOT, 0.0, ROOT)),
        Marker(11, 0.04, (0.0, 0.0545, 0.0545), (1.0, 0.0, 0.0), (0.0, ROOT, -ROOT)),
        Marker(12, 0.04, (0.0, -0.0545, 0.0545), (1.0, 0.0, 0.0), (0.0, ROOT, ROOT)),
    ),
    reset=("Put the ball, the small size 1, near the table's centre, marker 8 up.",),
    parts=(Part("sphere", (0.075,), density=113, friction=0.85, rolling=0.012, colour=(0.9, 0.9, 0.9)),),
)
GLASS_JAR = RobotObject(
    name="glass-jar",
    family="opening",
    size=(0.07, 0.07, 0.17),
    mass=0.35,
    markers=(Marker(13, 0.03, (0.065, 0.0, -0.075)), Marker(14, 0.03, (-0.065, 0.0, -0.075))),
    joint_markers=(_on_top(15, 0.03, 0.0, 0.0, 0.086),),
    reset=(
        "Screw the lid on until its mark meets the jar's.",
        "Stand the jar on its base plate near the table's centre.",
    ),
    parts=(
        Part("cylinder", (0.035, 0.005), (0.0, 0.0, -0.08), density=1500, friction=0.25, colour=GLASS),
        Part("capsule", (0.021, 0.0415), (0.0, 0.0, -0.0125), density=1500, friction=1.2, colour=GLASS),
    ),
    joint_parts=(
        Part("capsule", (0.022, 0.005), (0.0, 0.0, 0.058), density=900, friction=1.2, colour=STEEL),
    ),
    joint_friction=0.06,
)
WATER_BOTTLE = RobotObject(
    name="water-bottle",
    family="opening",
    size=(0.06, 0.06, 0.19),
    mass=0.4,
    markers=(Marker(16, 0.03, (0.06, 0.0, -0.085)), Marker(17, 0.03, (-0.06, 0.0, -0.085))),
    joint_markers=(_on_top(18, 0.03, 0.0, 0.0, 0.096),),
    reset=(
        "Screw the cap on until its mark meets the bottle's.",
        "Stand the bottle on its base plate near the table's centre.",
    ),
    parts=(
        Part("cylinder", (0.03, 0.005), (0.0, 0.0, -0.09), density=1000, friction=0.25, colour=GLASS),
        Part("capsule", (0.019, 0.051), (0.0, 0.0, -0.015), density=1000, friction=1.2, colour=GLASS),
    ),
    joint_parts=(Part("capsule", (0.02, 0.01), (0.0, 0.0, 0.065), friction=1.2, colour=PLASTIC),),
    joint_friction=0.06,
)
T_WRENCH = RobotObject(
    name="t-wrench",
    family="rotating",
    size=(0.24, 0.24, 0.2),
    mass=0.25,
    markers=(Marker(19, 0.04, (0.085, 0.0, -0.085)), Marker(20, 0.04, (-0.085, 0.0, -0.085))),
    joint_markers=(_along(21, 0.02, -0.09, 0.101), _along(22, 0.02, 0.09, 0.101)),
    reset=(
        "Stand it so that marker 20 lies on the left robot's left.",
        "Turn the handle back until marker 21 points at the left robot.",
    ),
    parts=_t_base(0.2, STEEL),
    joint_parts=_t_handle(0.2, 0.24, STEEL),
    joint_friction=0.05,
    location_range=(0.06, 0.03),
    faces=True,
)
CORKSCREW = RobotObject(
    name="corkscrew",
    family="rotating",
    size=(0.22, 0.22, 0.2),
    mass=0.25,
    markers=(Marker(23, 0.04, (0.085, 0.0, -0.085)), Marker(24, 0.04, (-0.085, 0.0, -0.085))),
    joint_markers=(_along(25, 0.02, -0.08, 0.101), _along(26, 0.02, 0.08, 0.101)),
    reset=(
        "Stand it so that marker 24 lies on the left robot's left.",
        "Turn the handle back until marker 25 points at the left robot.",
    ),
    parts=_t_base(0.2, WOOD),
    joint_parts=_t_handle(0.2, 0.22, WOOD),
    joint_friction=0.05,
    location_range=(0.06, 0.03),
    faces=True,
)

OBJECTS: dict[str, RobotObject] = {
    item.name: item
    for item in (
        ALUMINIUM_TRAY,
        ROLLING_PIN,
        HEAVY_BAR,
        PLASTIC_BOX,
        SOCCER_BALL,
        GLASS_JAR,
        WATER_BOTTLE,
        T_WRENCH,
        CORKSCREW,
    )
}
"""By name, in the order of the paper's Table I."""


def get_object(name: str) -> RobotObject:
    """Return an object.

    Raises:
        UnknownNameError: if there is none of this name; the message lists the valid ones.

    """
    if name not in OBJECTS:
        raise UnknownNameError("object", name, OBJECTS)
    return OBJECTS[name]
