"""Checking a set-up: what the camera sees of the markers, and whether it is good enough."""

from collections.abc import Callable, Sequence

import cv2
import numpy as np

from taskschema.arrays import FloatArray
from taskschema_robot.camera.camera import Frame, Intrinsics
from taskschema_robot.errors import CameraError
from taskschema_robot.finding import Finding
from taskschema_robot.objects.marker import table_markers
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.detector import MarkerDetector
from taskschema_robot.reward.poses import table_in_camera
from taskschema_robot.reward.tracker import ObjectTracker

SMALLEST_MARKER = 20.0
"""Edge of a marker in the picture [pixels] below which its pose is not to be trusted."""
LARGEST_SPREAD = 0.005
"""Of an object at rest, between frames [m]."""
LENS_VIEWS = 15
"""Asked for."""
LEAST_VIEWS = 8
"""Of the marker board, for the lens."""
LARGEST_RESIDUAL = 1.0
"""Of a lens [pixels]: beyond it, the views do not belong to one lens and one flat board."""


def check_view(frames: Sequence[Frame], intrinsics: Intrinsics, item: RobotObject | None) -> list[Finding]:
    """Return what a few frames of the table, and of an object at rest, show."""
    found = MarkerDetector().find(frames[-1].image)
    table, reason = table_in_camera(found, table_markers(), intrinsics)
    seen = [marker.number for marker in table_markers() if marker.number in found]
    findings = [Finding("table markers", table is not None, reason or f"seen: {', '.join(map(str, seen))}")]
    if table is not None:
        camera = table.inverse()
        tilt = np.rad2deg(np.arccos(np.clip(-camera.rotation[2, 2], -1.0, 1.0)))
        words = f"{camera.position[2]:.2f} m above the table, {tilt:.1f} degrees from straight down"
        findings.append(Finding("camera", bool(tilt < 15.0), words))
    if found:
        edge = min(float(np.hypot(*(corners[0] - corners[1]))) for corners in found.values())
        findings.append(
            Finding("marker size", edge >= SMALLEST_MARKER, f"the smallest is {edge:.0f} pixels wide")
        )
    if item is not None:
        findings.append(_object_at_rest(frames, intrinsics, item))
    return findings


def _object_at_rest(frames: Sequence[Frame], intrinsics: Intrinsics, item: RobotObject) -> Finding:
    tracker = ObjectTracker(item, intrinsics)
    sightings = [tracker.see(frame) for frame in frames]
    poses = [sighting.pose for sighting in sightings if sighting.pose is not None]
    if len(poses) < len(frames):
        reason = next(sighting.reason for sighting in sightings if sighting.pose is None)
        return Finding(item.name, False, f"known in {len(poses)} of {len(frames)} frames: {reason}")
    places = np.stack(poses)[:, :3]
    spread = float((places.max(axis=0) - places.min(axis=0)).max())
    x, y, z = np.median(places, axis=0)
    height = z - 0.5 * item.size[2]
    words = f"at x {x:+.3f}, y {y:+.3f} m, {1000 * height:+.0f} mm off the table, +-{500 * spread:.1f} mm"
    return Finding(item.name, spread < LARGEST_SPREAD and abs(height) < 0.02, words)


def calibrate_lens(
    take: Callable[[], Frame], views: int, say: Callable[[str], None]
) -> tuple[Intrinsics, float]:
    """Return a camera's intrinsics from views of the table's markers at different angles, and the residual.

    Args:
        take: waits for the person to tilt the camera or the sheet, and takes a picture.
        views: how many, at least `LEAST_VIEWS`.
        say: tells the person.

    Raises:
        CameraError: if too few views show enough markers, or no lens fits them.

    """
    detector, board = MarkerDetector(), {marker.number: marker.corners for marker in table_markers()}
    points: list[FloatArray] = []
    pixels: list[FloatArray] = []
    size = (0, 0)
    for number in range(views):
        frame = take()
        size = (frame.image.shape[1], frame.image.shape[0])
        found = {key: value for key, value in detector.find(frame.image).items() if key in board}
        say(f"view {number + 1} of {views}: {len(found)} markers")
        if len(found) >= 4:
            points.append(np.concatenate([board[key] for key in found]).astype(np.float32))
            pixels.append(np.concatenate(list(found.values())).astype(np.float32))
    if len(points) < LEAST_VIEWS:
        raise CameraError(
            f"{len(points)} views show four markers or more, {LEAST_VIEWS} are needed: take more."
        )
    residual, matrix, distortion, _, _ = cv2.calibrateCamera(points, pixels, size, None, None)
    if not residual <= LARGEST_RESIDUAL:
        raise CameraError(
            f"The lens that fits these views best is {residual:.1f} pixels off on average, "
            f"{LARGEST_RESIDUAL:.0f} is the most: take them again, with the six markers flat and where they "
            "belong to the millimetre, focus and zoom fixed, and nothing moving while a picture is taken."
        )
    lens = Intrinsics(np.asarray(matrix, np.float64), np.ravel(distortion)[:5].astype(np.float64))
    return lens, float(residual)
