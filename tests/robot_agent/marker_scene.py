"""Pictures of markers from above, each drawn by its homography."""

import cv2
import numpy as np

from taskschema.kinematics.rotation import vertical_turn
from taskschema_robot.camera.camera import Frame, Intrinsics
from taskschema_robot.objects.marker import DICTIONARY, Marker, table_markers
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.poses import Pose

WIDTH, HEIGHT = 1920, 1080
FOCAL = 1450.0
CELLS = 6
"""Of a 4 x 4 marker with its black border."""
PIXELS_PER_CELL = 20
INTRINSICS = Intrinsics(
    np.array([[FOCAL, 0.0, 0.5 * WIDTH], [0.0, FOCAL, 0.5 * HEIGHT], [0.0, 0.0, 1.0]]), np.zeros(5)
)
FROM_ABOVE = Pose(np.array([0.01, -0.02, 1.4]), np.diag([1.0, -1.0, -1.0]) @ vertical_turn(np.array(0.02)))
"""The camera in the world's frame: 1.4 m up, looking down, a little off."""


def draw(markers, camera: Pose = FROM_ABOVE, noise: float = 2.0, seed: int = 0) -> np.ndarray:
    """A picture [H, W, 3] of (marker, pose of its link in the world) pairs, lower ones first."""
    scale = 2
    canvas = np.full((HEIGHT * scale, WIDTH * scale), 150, dtype=np.uint8)
    matrix = INTRINSICS.matrix.copy()
    matrix[:2] *= scale
    inverse = camera.inverse()
    turn, _ = cv2.Rodrigues(inverse.rotation)
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    for marker, link in sorted(markers, key=lambda item: item[1].position[2] + item[0].position[2]):
        corners = marker.corners @ link.rotation.T + link.position
        normal = np.cross(corners[1] - corners[0], corners[0] - corners[3])
        if np.dot(normal, camera.position - corners.mean(axis=0)) <= 0.0:
            continue  # it faces away
        side = CELLS * PIXELS_PER_CELL
        face = cv2.aruco.generateImageMarker(dictionary, marker.number, side)
        face = cv2.copyMakeBorder(face, *[PIXELS_PER_CELL] * 4, cv2.BORDER_CONSTANT, value=255)
        seen, _ = cv2.projectPoints(corners, turn, inverse.position, matrix, INTRINSICS.distortion)
        first, last = PIXELS_PER_CELL - 0.5, PIXELS_PER_CELL + side - 0.5
        square = np.array([[first, first], [last, first], [last, last], [first, last]], dtype=np.float32)
        target = seen[:, 0].astype(np.float32)
        low = np.floor(target.min(axis=0)).astype(int) - 40
        high = np.ceil(target.max(axis=0)).astype(int) + 40
        low, high = np.maximum(low, 0), np.minimum(high, canvas.shape[::-1])
        if (high <= low).any():
            continue
        transform = cv2.getPerspectiveTransform(square, target - low.astype(np.float32))
        size = tuple(int(edge) for edge in high - low)
        mask = cv2.warpPerspective(np.full_like(face, 255), transform, size)
        drawn = cv2.warpPerspective(face, transform, size, flags=cv2.INTER_AREA)
        part = canvas[low[1] : high[1], low[0] : high[0]]
        part[mask > 127] = drawn[mask > 127]
    small = cv2.resize(canvas, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(np.float32)
    small += noise * np.random.default_rng(seed).standard_normal(small.shape, dtype=np.float32)
    return np.repeat(np.clip(small, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)


def picture_of(
    item: RobotObject,
    pose: Pose,
    angle: float = 0.0,
    *,
    hidden: tuple[int, ...] = (),
    camera: Pose = FROM_ABOVE,
    time: float = 0.0,
    seed: int = 0,
) -> Frame:
    """A frame of the table and one object, its turning link at `angle`, some markers covered."""
    table = Pose(np.zeros(3), np.eye(3))
    turning = pose @ Pose(np.zeros(3), vertical_turn(np.array(angle)))
    shown: list[tuple[Marker, Pose]] = [(marker, table) for marker in table_markers()]
    shown += [(marker, pose) for marker in item.markers]
    shown += [(marker, turning) for marker in item.joint_markers]
    shown = [(marker, link) for marker, link in shown if marker.number not in hidden]
    return Frame(time, seed, draw(shown, camera, seed=seed))


def standing(
    item: RobotObject, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, height: float = 0.0
) -> Pose:
    """The pose of an object as it stands on the table, or `height` [m] above it."""
    return Pose(np.array([x, y, 0.5 * item.size[2] + height]), vertical_turn(np.array(yaw)))
