"""Finding printed markers in a picture, at the camera's own resolution."""

import cv2
import numpy as np

from taskschema.arrays import FloatArray
from taskschema_robot.camera.camera import Image
from taskschema_robot.objects.marker import DICTIONARY

Corners = dict[int, FloatArray]
"""[4, 2] corners by marker number: top left, top right, bottom right, bottom left [pixels]."""


class MarkerDetector:
    """ArUco with sub-pixel corners."""

    def __init__(self) -> None:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        self._detector = cv2.aruco.ArucoDetector(dictionary, parameters)

    def find(self, image: Image) -> Corners:
        """Return the markers in an image [H, W, 3], red, green, blue; a number seen twice is unseen."""
        found, numbers, _ = self._detector.detectMarkers(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        if numbers is None:
            return {}
        flat = [int(number) for number in np.ravel(numbers)]
        return {
            number: np.asarray(corners, dtype=np.float64).reshape(4, 2)
            for number, corners in zip(flat, found, strict=True)
            if flat.count(number) == 1
        }


def draw_found(image: Image, found: Corners) -> Image:
    """Return a copy with the markers outlined and numbered, as evidence."""
    picture = image.copy()
    if found:
        corners = [value.astype(np.float32)[None] for value in found.values()]
        cv2.aruco.drawDetectedMarkers(picture, corners, np.array(list(found), dtype=np.int32)[:, None])
    return picture
