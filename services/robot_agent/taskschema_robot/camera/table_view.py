"""The overhead frame that policies see, cut out of a camera's own picture."""

import cv2
import numpy as np

from taskschema.arrays import FloatArray
from taskschema.frames import FRAME_SIZE
from taskschema_robot.camera.camera import Image, Intrinsics

FINER = 3
"""The picture is first drawn so many times larger, and each pixel is then the mean of what it covers."""


class TableView:
    """What simulation's overhead camera sees: a square of table top, x to the right, y up, without lens.

    The table's plane comes to lie as in simulation. What stands on it is seen from where the camera really
    hangs; that is a policy's to learn.

    Args:
        intrinsics: of the camera at its own resolution.
        position: [3] of the table's frame in the camera's [m].
        rotation: [3, 3] of the same.
        view: edge length of the square, about the table's centre [m].

    """

    def __init__(
        self, intrinsics: Intrinsics, position: FloatArray, rotation: FloatArray, view: float
    ) -> None:
        count = FINER * FRAME_SIZE
        along = (np.arange(count) + 0.5) / count - 0.5
        x, y = np.meshgrid(view * along, -view * along)
        points = np.stack([x.ravel(), y.ravel(), np.zeros(count * count)], axis=1)
        turn = cv2.Rodrigues(rotation)[0]
        pixels, _ = cv2.projectPoints(points, turn, position, intrinsics.matrix, intrinsics.distortion)
        self._columns, self._rows = np.moveaxis(pixels.reshape(count, count, 2), 2, 0).astype(np.float32)

    def frame(self, picture: Image) -> Image:
        """Return the frame [256, 256, 3] of a picture [H, W, 3] of the camera."""
        fine = cv2.remap(picture, self._columns, self._rows, cv2.INTER_LINEAR)
        small = cv2.resize(fine, (FRAME_SIZE, FRAME_SIZE), interpolation=cv2.INTER_AREA)
        return np.asarray(small, dtype=np.uint8)
