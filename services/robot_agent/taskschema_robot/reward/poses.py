"""Where the camera is, and where things are on the table, from markers' corners."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from taskschema.arrays import FloatArray
from taskschema_robot.camera.camera import Intrinsics
from taskschema_robot.objects.marker import Marker
from taskschema_robot.reward.detector import Corners

LEAST_TABLE_MARKERS = 4
"""Fewer do not show whether the camera was bumped."""
LARGEST_RESIDUAL = 2.0
"""Root mean square distance of corners from where the solution puts them [pixels]."""
CLEARLY_BETTER = 2.0
"""One of a square's two poses is taken for certain if the other's residual is so many times larger."""
SAME_TILT = np.deg2rad(10.0)
"""Two poses whose normals differ by less than this are one [rad]."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A frame in another one."""

    position: FloatArray
    """[3] in metres."""
    rotation: FloatArray
    """[3, 3]"""

    def inverse(self) -> "Pose":
        """Return the other frame in this one."""
        return Pose(-self.rotation.T @ self.position, self.rotation.T)

    def __matmul__(self, other: "Pose") -> "Pose":
        """Return `other`, given in this frame, in this frame's own frame."""
        return Pose(self.position + self.rotation @ other.position, self.rotation @ other.rotation)


def table_in_camera(
    found: Corners, markers: Sequence[Marker], intrinsics: Intrinsics
) -> tuple[Pose | None, str]:
    """Return the table's frame in the camera's, or None and why not; solved again in every frame."""
    seen = [marker for marker in markers if marker.number in found]
    if len(seen) < LEAST_TABLE_MARKERS:
        return (
            None,
            f"{len(seen)} of the table's {len(markers)} markers are seen, {LEAST_TABLE_MARKERS} needed",
        )
    candidates = _solutions(found, seen, intrinsics)
    if not candidates or candidates[0][1] > LARGEST_RESIDUAL:
        worst = candidates[0][1] if candidates else np.inf
        return None, f"the table's markers do not lie where they should: {worst:.1f} pixels off"
    return candidates[0][0], ""


def link_on_table(
    found: Corners, markers: Sequence[Marker], intrinsics: Intrinsics, table: Pose, upright: FloatArray
) -> tuple[Pose | None, str]:
    """Return a link's frame in the table's, or None and why not.

    Args:
        found: in the picture.
        markers: on the link.
        intrinsics: of the camera.
        table: in the camera's frame.
        upright: [3] the link's last known z axis in the table's frame: decides between the two poses that
            a single square may have.
    """
    seen = [marker for marker in markers if marker.number in found]
    if not seen:
        numbers = ", ".join(str(marker.number) for marker in markers)
        return None, f"none of its markers ({numbers}) is seen"
    candidates = [
        (table.inverse() @ pose, residual)
        for pose, residual in _solutions(found, seen, intrinsics)
        if residual <= LARGEST_RESIDUAL
    ]
    if not candidates:
        return None, "its markers are seen, but not where they could be"
    best, residual = candidates[0]
    rivals = [pose for pose, other in candidates[1:] if other < CLEARLY_BETTER * residual + 0.05]
    for rival in rivals:
        if np.dot(rival.rotation[:, 2], upright) > np.dot(best.rotation[:, 2], upright):
            best = rival
    return best, ""


def _solutions(found: Corners, markers: Sequence[Marker], intrinsics: Intrinsics) -> list[tuple[Pose, float]]:
    """Return poses of the markers' link in the camera's frame with their residuals [pixels], best first."""
    image = np.concatenate([found[marker.number] for marker in markers])
    if len(markers) == 1:
        marker = markers[0]
        half = 0.5 * marker.size
        points = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
        method = cv2.SOLVEPNP_IPPE_SQUARE
    else:
        points = np.concatenate([marker.corners for marker in markers])
        method = cv2.SOLVEPNP_SQPNP
    count, turns, shifts, _ = cv2.solvePnPGeneric(
        points, image, intrinsics.matrix, intrinsics.distortion, flags=method
    )
    solutions = []
    for turn, shift in zip(turns[:count], shifts[:count], strict=True):
        if len(markers) > 1:
            turn, shift = cv2.solvePnPRefineLM(
                points, image, intrinsics.matrix, intrinsics.distortion, turn, shift
            )
        again, _ = cv2.projectPoints(points, turn, shift, intrinsics.matrix, intrinsics.distortion)
        residual = float(np.sqrt(((again[:, 0] - image) ** 2).sum(axis=1).mean()))
        pose = Pose(np.asarray(shift[:, 0], np.float64), np.asarray(cv2.Rodrigues(turn)[0], np.float64))
        if len(markers) == 1:
            pose = pose @ _marker_frame(markers[0]).inverse()
        solutions.append((pose, residual))
    return sorted(solutions, key=lambda item: item[1])


def _marker_frame(marker: Marker) -> Pose:
    x, y = np.asarray(marker.x_axis, dtype=np.float64), np.asarray(marker.y_axis, dtype=np.float64)
    return Pose(np.asarray(marker.position, dtype=np.float64), np.stack([x, y, np.cross(x, y)], axis=1))
