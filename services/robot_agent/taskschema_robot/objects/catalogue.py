"""The nine objects of Table I. The paper gives no dimensions: these are of usual household ones.

Measure yours, and change its entry: the gate sweeps what the hands hold by these sizes, and the reward
computes poses from where the markers sit.
"""

import numpy as np

from taskschema.errors import UnknownNameError
from taskschema_robot.objects.marker import Marker
from taskschema_robot.objects.robot_object import Part, RobotObject

WOOD, STEEL, GLASS, PLASTIC = (0.72, 0.53, 0.35), (0.55, 0.57, 0.6), (0.5, 0.7, 0.65), (0.25, 0.4, 0.7)
DIAGONAL = np.pi / 4


def _on_top(number: int, size: float, x: float, y: float, z: float) -> Marker:
    return Marker(number, size, (x, y, z))


ALUMINIUM_TRAY = RobotObject(
    name="aluminium-tray",
    family="lateral_lifting",
    size=(0.46, 0.30, 0.03),
    mass=0.5,
    markers=(_on_top(0, 0.06, -0.18, 0.0, -0.012), _on_top(1, 0.06, 0.18, 0.0, -0.012)),
    reset=(
        "Put the tray flat on the table, its long side towards you.",
        "Turn it so that marker 0 lies on the left robot's left.",
    ),
    parts=(
        Part("box", (0.23, 0.15, 0.0015), (0.0, 0.0, -0.0135), density=2700, colour=STEEL),
        Part("box", (0.23, 0.002, 0.015), (0.0, 0.148, 0.0), density=900, friction=1.05, colour=STEEL),
        Part("box", (0.23, 0.002, 0.015), (0.0, -0.148, 0.0), density=900, friction=1.05, colour=STEEL),
    ),
)
ROLLING_PIN = RobotObject(
    name="rolling-pin",
    family="lateral_lifting",
    size=(0.44, 0.05, 0.05),
    mass=0.6,
    markers=(_on_top(2, 0.03, -0.17, 0.0, 0.026), _on_top(3, 0.03, 0.17, 0.0, 0.026)),
    reset=("Lay the rolling pin between the robots, diagonally, its flats with the markers up.",),
    parts=(
        Part("capsule", (0.025, 0.1), euler=(0.0, np.pi / 2, 0.0), density=700, friction=1.0, colour=WOOD),
        Part("capsule", (0.014, 0.2), euler=(0.0, np.pi / 2, 0.0), density=1200, friction=1.0, colour=WOOD),
    ),
    yaw=DIAGONAL,
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
)
PLASTIC_BOX = RobotObject(
    name="plastic-box",
    family="lateral_lifting",
    size=(0.34, 0.22, 0.12),
    mass=0.7,
    markers=(_on_top(6, 0.06, -0.12, 0.0, 0.061), _on_top(7, 0.06, 0.12, 0.0, 0.061)),
    reset=("Put the box with its lid closed and its long side towards you, marker 6 on your left.",),
    parts=(
        Part("box", (0.17, 0.10, 0.055), (0.0, 0.0, -0.005), density=90, colour=PLASTIC),
        Part("box", (0.17, 0.003, 0.06), (0.0, 0.107, 0.0), density=900, friction=1.05, colour=PLASTIC),
        Part("box", (0.17, 0.003, 0.06), (0.0, -0.107, 0.0), density=900, friction=1.05, colour=PLASTIC),
    ),
)
SOCCER_BALL = RobotObject(
    name="soccer-ball",
    family="picking",
    size=(0.22, 0.22, 0.22),
    mass=0.43,
    markers=(
        _on_top(8, 0.05, 0.0, 0.0, 0.112),
        Marker(9, 0.05, (0.079, 0.0, 0.079), (0.7071067811865476, 0.0, -0.7071067811865476)),
        Marker(10, 0.05, (-0.079, 0.0, 0.079), (0.7071067811865476, 0.0, 0.7071067811865476)),
        Marker(
            11, 0.05, (0.0, 0.079, 0.079), (1.0, 0.0, 0.0), (0.0, 0.7071067811865476, -0.7071067811865476)
        ),
        Marker(
            12, 0.05, (0.0, -0.079, 0.079), (1.0, 0.0, 0.0), (0.0, 0.7071067811865476, 0.7071067811865476)
        ),
    ),
    reset=("Put the ball into its ring near the table's centre, marker 8 up.",),
    parts=(Part("sphere", (0.11,), density=77, friction=0.5, colour=(0.9, 0.9, 0.9)),),
)
GLASS_JAR = RobotObject(
    name="glass-jar",
    family="opening",
    size=(0.07, 0.07, 0.14),
    mass=0.35,
    markers=(Marker(13, 0.03, (0.065, 0.0, -0.06)), Marker(14, 0.03, (-0.065, 0.0, -0.06))),
    joint_markers=(_on_top(15, 0.03, 0.0, 0.0, 0.071),),
    reset=(
        "Screw the lid on until its mark meets the jar's.",
        "Stand the jar on its base plate near the table's centre.",
    ),
    parts=(
        Part("cylinder", (0.035, 0.004), (0.0, 0.0, -0.066), density=1500, friction=0.25, colour=GLASS),
        Part("capsule", (0.021, 0.03), (0.0, 0.0, -0.01), density=1500, friction=1.2, colour=GLASS),
    ),
    joint_parts=(Part("capsule", (0.021, 0.01), (0.0, 0.0, 0.039), density=900, friction=1.2, colour=STEEL),),
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
    size=(0.3, 0.1, 0.16),
    mass=0.6,
    markers=(Marker(19, 0.04, (0.0, 0.08, -0.075)), Marker(20, 0.04, (0.0, -0.08, -0.075))),
    joint_markers=(_on_top(21, 0.03, -0.12, 0.0, 0.08), _on_top(22, 0.03, 0.12, 0.0, 0.08)),
    reset=("Turn the handle back until marker 21 points to the left robot's left.",),
    parts=(
        Part("box", (0.05, 0.05, 0.02), (0.0, 0.0, -0.06), density=2500, friction=0.25, colour=STEEL),
        Part("capsule", (0.018, 0.04), (0.0, 0.0, 0.0), friction=1.2, colour=STEEL),
    ),
    joint_parts=(
        Part("capsule", (0.012, 0.138), (0.0, 0.0, 0.068), (0.0, np.pi / 2, 0.0), friction=1.2, colour=STEEL),
    ),
    joint_friction=0.08,
)
CORKSCREW = RobotObject(
    name="corkscrew",
    family="rotating",
    size=(0.2, 0.08, 0.15),
    mass=0.4,
    markers=(Marker(23, 0.03, (0.0, 0.065, -0.07)), Marker(24, 0.03, (0.0, -0.065, -0.07))),
    joint_markers=(_on_top(25, 0.025, -0.08, 0.0, 0.075), _on_top(26, 0.025, 0.08, 0.0, 0.075)),
    reset=("Turn the handle back until marker 25 points to the left robot's left.",),
    parts=(
        Part("box", (0.04, 0.04, 0.02), (0.0, 0.0, -0.055), density=2500, friction=0.25, colour=WOOD),
        Part("capsule", (0.018, 0.035), (0.0, 0.0, 0.0), friction=1.2, colour=WOOD),
    ),
    joint_parts=(
        Part("capsule", (0.011, 0.089), (0.0, 0.0, 0.064), (0.0, np.pi / 2, 0.0), friction=1.2, colour=WOOD),
    ),
    joint_friction=0.08,
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
