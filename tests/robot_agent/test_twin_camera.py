"""The overhead camera: printed markers where they really are."""

import cv2
import numpy as np
import pytest
from rendering_setup import needs_renderer
from twin_setup import LockStep

from taskschema.kinematics.rotation import rotate
from taskschema_robot.objects.catalogue import HEAVY_BAR, WATER_BOTTLE
from taskschema_robot.objects.marker import DICTIONARY, table_markers
from taskschema_robot.twin.camera import LockStepCamera
from taskschema_robot.twin.scene import CAMERA_HEIGHT, PICTURE, intrinsics
from taskschema_robot.twin.service import pose_on_table

pytestmark = needs_renderer


def project(points: np.ndarray) -> np.ndarray:
    """Pixels [N, 2] of world points [N, 3]: the camera looks straight down, its picture's top is y."""
    matrix = intrinsics().matrix
    depth = CAMERA_HEIGHT - points[:, 2]
    return np.stack(
        [
            matrix[0, 0] * points[:, 0] / depth + matrix[0, 2],
            -matrix[1, 1] * points[:, 1] / depth + matrix[1, 2],
        ],
        axis=1,
    )


def detect(image: np.ndarray) -> dict[int, np.ndarray]:
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY)))
    corners, numbers, _ = detector.detectMarkers(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
    return {int(number): found[0] for number, found in zip(numbers.ravel(), corners, strict=True)}


@pytest.mark.parametrize("item", [HEAVY_BAR, WATER_BOTTLE], ids=lambda item: item.name)
def test_markers_are_seen_where_they_are(item):
    rig = LockStep(item)
    try:
        rig.client.place_object(pose_on_table(item, 0.03, -0.04, 0.1))
        rig.sleep(0.3)
        frame = LockStepCamera(rig.client, rig.clock).latest()
        pose = rig.client.object_pose()
        assert frame.image.shape == (PICTURE, PICTURE, 3)
        found = detect(frame.image)
    finally:
        rig.close()
    assert {marker.number for marker in table_markers()} <= set(found)
    placed = {marker.number: marker.corners for marker in table_markers()}
    for marker in (*item.markers, *item.joint_markers):
        placed[marker.number] = pose[:3] + rotate(pose[3:7], marker.corners)
    assert len(set(found) & set(placed)) >= len(placed) - 1  # one may be hidden by an arm
    for number, corners in found.items():
        assert np.abs(project(placed[number]) - corners).max() < 2.0  # pixels
