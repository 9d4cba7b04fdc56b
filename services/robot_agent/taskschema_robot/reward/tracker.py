"""The object's pose over time, frame by frame: for the reward, and for a state observation."""

import threading
from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.rotation import matrix_to_quaternion
from taskschema_robot.camera.camera import Frame, Intrinsics
from taskschema_robot.objects.marker import Marker, table_markers
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.detector import Corners, MarkerDetector
from taskschema_robot.reward.poses import Pose, link_on_table, table_in_camera

FORWARDS = np.deg2rad(330.0)
"""Less than this a hinge is turned forwards while nobody sees it [rad]: skills turn it that way."""
BACKWARDS = np.deg2rad(180.0)
"""At most this far a hand knocks it backwards meanwhile [rad]."""
UNSEEN_SECONDS = 0.5
"""Longest gap between frames [s] over which a hinge's angle is followed the short way around."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """What one frame shows of the object."""

    frame: Frame
    found: Corners
    pose: FloatArray | None
    """[7 + h] centre, quaternion w x y z, and the hinge's angle [rad], in the world frame; None: unknown."""
    reason: str
    """Why it is unknown."""
    doubtful: bool = False
    """Whether the hinge may as well stand a full turn behind: nobody saw which way it was turned."""


class ObjectTracker:
    """Follows one object; the hinge's angle is unwrapped over time, half turns and more included.

    Threads may share it.

    Args:
        item: the object.
        intrinsics: of the camera at its own resolution.
        table: the markers fixed to the table.

    """

    def __init__(
        self, item: RobotObject, intrinsics: Intrinsics, table: tuple[Marker, ...] | None = None
    ) -> None:
        self._item = item
        self._intrinsics = intrinsics
        self._table = table or table_markers()
        self._detector = MarkerDetector()
        self._lock = threading.Lock()
        self.reset()

    def reset(self) -> None:
        """Forget the object: a new episode starts, with the hinge at 0."""
        with self._lock:
            self._forget()

    def _forget(self) -> None:
        self._root: Pose | None = None
        self._upright: FloatArray = np.array([0.0, 0.0, 1.0])
        self._angle: float | None = None
        self._angle_time = -np.inf
        self._zero: float | None = None
        self._doubtful = False

    @property
    def first_angle(self) -> float:
        """The hinge's angle at which a new episode found it, as its markers have it, in (-pi, pi] [rad]."""
        return self._zero or 0.0

    def see(self, frame: Frame) -> Sighting:
        """Return what a frame shows; frames come in the order of their times, nearly."""
        with self._lock:
            return self._see(frame)

    def _see(self, frame: Frame) -> Sighting:
        found = self._detector.find(frame.image)
        table, reason = table_in_camera(found, self._table, self._intrinsics)
        if table is None:
            return Sighting(frame, found, None, reason)
        root, reason = link_on_table(found, self._item.markers, self._intrinsics, table, self._upright)
        if root is not None:
            self._root, self._upright = root, root.rotation[:, 2]
        angle, why_not = self._hinge(found, table, frame.time)
        if root is None:
            return Sighting(frame, found, None, f"{self._item.name}: {reason}")
        if why_not:
            return Sighting(frame, found, None, f"{self._item.name}, turning part: {why_not}")
        pose = np.concatenate([root.position, matrix_to_quaternion(root.rotation), angle])
        return Sighting(frame, found, pose, "", self._doubtful)

    def _hinge(self, found: Corners, table: Pose, time: float) -> tuple[FloatArray, str]:
        """Return the hinge's angle [h], or none and why not; a root that is hidden is where it was."""
        if not self._item.joint_markers or self._root is None:
            return np.zeros(0), ""
        turning, reason = link_on_table(
            found, self._item.joint_markers, self._intrinsics, table, self._upright
        )
        if turning is None:
            return np.zeros(0), reason
        return np.array([self._unwrapped(_yaw_between(self._root, turning), time)]), ""

    def _unwrapped(self, yaw: float, time: float) -> float:
        """Return the hinge's angle since the start [rad], from its yaw relative to the root, in (-pi, pi]."""
        if self._zero is None:
            self._zero = yaw
        turned = yaw - self._zero
        if self._angle is None:
            angle = _nearest(turned, 0.0)
        elif time - self._angle_time <= UNSEEN_SECONDS:
            angle = _nearest(turned, self._angle)
        else:
            angle = self._angle + self._unseen_turn(turned - self._angle)
        self._angle, self._angle_time = float(angle), max(time, self._angle_time)
        return float(angle)

    def _unseen_turn(self, turn: float) -> float:
        """Return how far a hinge turned that was hidden [rad], full turns aside: forwards if it can be."""
        forwards = float(np.mod(turn, 2.0 * np.pi))
        backwards = forwards - 2.0 * np.pi
        if forwards >= FORWARDS:
            return backwards
        self._doubtful |= bool(backwards >= -BACKWARDS)
        return forwards


def _nearest(angle: float, reference: float) -> float:
    """Return the angle plus full turns that is nearest to the reference."""
    return float(angle + 2.0 * np.pi * np.round((reference - angle) / (2.0 * np.pi)))


def _yaw_between(root: Pose, turning: Pose) -> float:
    relative = root.rotation.T @ turning.rotation
    return float(np.arctan2(relative[1, 0] - relative[0, 1], relative[0, 0] + relative[1, 1]))
