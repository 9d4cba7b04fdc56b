"""A trial of the one frame that bases, table and markers share: each hand goes to where two markers are."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair
from taskschema.safety.limits import SafetyLimits
from taskschema.skills.pairs import ARMS
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_robot.agent.slow_motion import measured_joints, move, slow_motion
from taskschema_robot.errors import RobotError
from taskschema_robot.finding import Finding
from taskschema_robot.objects.marker import Marker, table_markers
from taskschema_robot.safety.gated_arms import GatedArms
from taskschema_robot.safety.homing import return_home

HEIGHT = 0.1
"""Of the finger tips above a marker [m]."""
MOST = 5.0
"""By how much a hand may be beside a marker, along x and along y [mm]: a third of the arms' clearance."""


@dataclass(frozen=True)
class Offset:
    """What a person measured."""

    marker: Marker
    x: float
    """From the marker's centre to below the middle between the finger tips, to the marker's right [mm]."""
    y: float
    """The same to the marker's top [mm]."""

    @property
    def good(self) -> bool:
        """Whether it is no more than it may be; no number at all is not."""
        return abs(self.x) <= MOST and abs(self.y) <= MOST


class FrameTrial:
    """Sends one hand above a marker of the table, from home.

    Args:
        arms: behind the gate.
        limits: the gate's.

    """

    def __init__(self, arms: GatedArms, limits: SafetyLimits) -> None:
        self._arms, self._limits = arms, limits
        self._home = LateralLifting().home_joints

    def go_home(self) -> None:
        """Bring both arms home, slowly.

        Raises:
            RobotError: if there is no safe way, or a fault stops them.

        """
        wide, limits = np.full(2, rethink_gripper().open), self._limits
        return_home(self._arms, self._home, wide, period=limits.period, speed_ratio=limits.speed_ratio)

    def go_above(self, arm: int, marker: Marker) -> None:
        """Bring a hand (0 left, 1 right) above a marker, pointing down.

        Raises:
            RobotError: if the gate refuses it, or a fault stops it.

        """
        self.go_home()
        start = measured_joints(self._arms)
        end = start.copy()
        end[arm] = above(arm, marker, self._home)
        move(self._arms, slow_motion(start, end, self._limits))


def above(arm: int, marker: Marker, home: FloatArray) -> FloatArray:
    """Return joint angles [7] of a hand that points down, its finger tips `HEIGHT` above a marker [rad].

    Raises:
        RobotError: if the arm does not reach there.

    """
    kinematics, seed = sawyer_pair()[arm], home[arm : arm + 1]
    _, rotation = kinematics.forward(seed)
    place = np.array([marker.position]) + [0.0, 0.0, HEIGHT + rethink_gripper().fingertip]
    result = solve_inverse(kinematics, place, rotation, seed)
    if not result.reached[0]:
        raise RobotError(f"the {ARMS[arm]} arm does not reach above marker {marker.number}.")
    return np.asarray(result.joints[0])


def markers_near(arm: int) -> list[Marker]:
    """Return the two markers at an arm's own end of the table, left of the right one."""
    side = (-1.0, 1.0)[arm]
    ranked = sorted(table_markers(), key=lambda marker: (-side * marker.position[1], marker.position[0]))
    return ranked[:2]


def judge(arm: int, offsets: list[Offset]) -> Finding:
    """Return what the offsets of one hand above its two markers say of where its base stands."""
    what = f"{ARMS[arm]} hand above markers"
    said = ", ".join(
        f"{item.marker.number}: x {round(item.x):+d}, y {round(item.y):+d} mm" for item in offsets
    )
    if all(item.good for item in offsets):
        return Finding(what, True, said)
    first, second = offsets[0], offsets[-1]
    x, y = 0.5 * (first.x + second.x), 0.5 * (first.y + second.y)
    if max(abs(first.x - second.x), abs(first.y - second.y)) <= MOST:
        advice = f"its base, or the table, is {round(x):+d}, {round(y):+d} mm off: move it back by that"
    else:
        advice = "the two differ: measure where both markers lie, then whether the base is turned"
    return Finding(what, False, f"{said}, {MOST:.0f} mm are the most: {advice}, then check again")
