"""The object's pose over time, frame by frame: for the reward, and for a state observation."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.rotation import matrix_to_quaternion
from taskschema_robot.camera.camera import Frame, Intrinsics
from taskschema_robot.objects.marker import Marker, table_markers
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.detector import Corners, MarkerDetector
from taskschema_robot.reward.poses import Pose, link_on_table, table_in_camera

BACKWARDS = np.deg2rad(60.0)
"""How far a hinge may have been turned backwards while nobody saw it [rad]: skills turn it the other way."""
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


class ObjectTracker:
    """Follows one object; the hinge's angle is unwrapped over time, half turns and more included.

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
        self.reset()

    def reset(self) -> None:
        """Forget the object: a new episode starts, with the hinge at 0."""
        self._upright: FloatArray = np.array([0.0, 0.0, 1.0])
        self._angle: float | None = None
        self._angle_time = -np.inf
        self._zero: float | None = None

    def see(self, frame: Frame) -> Sighting:
        """Return what a frame shows; frames come in the order of their times."""
        found = self._detector.find(frame.image)
        table, reason = table_in_camera(found, self._table, self._intrinsics)
        if table is None:
            return Sighting(frame, found, None, reason)
        root, reason = link_on_table(found, self._item.markers, self._intrinsics, table, self._upright)
        if root is None:
            return Sighting(frame, found, None, f"{self._item.name}: {reason}")
        self._upright = root.rotation[:, 2]
        pose = np.concatenate([root.position, matrix_to_quaternion(root.rotation)])
        if not self._item.joint_markers:
            return Sighting(frame, found, pose, "")
        turning, reason = link_on_table(
            found, self._item.joint_markers, self._intrinsics, table, self._upright
        )
        if turning is None:
            return Sighting(frame, found, None, f"{self._item.name}, turning part: {reason}")
        angle = self._unwrapped(_yaw_between(root, turning), frame.time)
        return Sighting(frame, found, np.append(pose, angle), "")

    def _unwrapped(self, yaw: float, time: float) -> float:
        """Return the hinge's angle since the start [rad], from its yaw relative to the root, in (-pi, pi]."""
        if self._zero is None:
            self._zero = yaw
        turned = yaw - self._zero
        if self._angle is None:
            angle = _nearest(turned, 0.0)
        elif time - self._angle_time <= UNSEEN_SECONDS:
            angle = _nearest(turned, self._angle)
        else:  # it was hidden: skills turn it forwards, by less than a full turn
            angle = self._angle + np.mod(turned - self._angle + BACKWARDS, 2.0 * np.pi) - BACKWARDS
        self._angle, self._angle_time = float(angle), time
        return float(angle)


def _nearest(angle: float, reference: float) -> float:
    """Return the angle plus full turns that is nearest to the reference."""
    return float(angle + 2.0 * np.pi * np.round((reference - angle) / (2.0 * np.pi)))


def _yaw_between(root: Pose, turning: Pose) -> float:
    relative = root.rotation.T @ turning.rotation
    return float(np.arctan2(relative[1, 0] - relative[0, 1], relative[0, 0] + relative[1, 1]))
