"""A camera on this machine."""

import cv2
import numpy as np

from taskschema_robot.camera.camera import Frame
from taskschema_robot.camera.reading_thread import ReadingThread
from taskschema_robot.clock import Clock
from taskschema_robot.errors import CameraError


class VideoCamera:
    """Anything that OpenCV opens: a number of a local camera, a device's path, a stream's address.

    Args:
        source: such as `0`, `/dev/video2` or `rtsp://...`.
        size: width and height to ask the camera for [pixels].
        clock: that frames are stamped with when they have been read.
        exact: whether a picture of another size is refused: a lens file holds for one size only.

    """

    def __init__(self, source: str, size: tuple[int, int], clock: Clock, *, exact: bool = True) -> None:
        self._source = source
        self._asked, self._exact = size, exact
        self._clock = clock
        self._count = 0
        self._capture = cv2.VideoCapture()
        self._open()
        self._reader = ReadingThread(self._read, self._open, repr(source))

    def _open(self) -> None:
        """Open the source, once more if it was open; in the reading thread then."""
        self._capture.release()
        if not self._capture.open(int(self._source) if self._source.isdigit() else self._source):
            raise CameraError(
                f"Camera {self._source!r} cannot be opened: check that it is connected, that this user may"
                " read it, and that no other program uses it."
            )
        self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._asked[0])
        self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._asked[1])
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)

    def _read(self) -> Frame:
        good, picture = self._capture.read()
        if not good:
            raise CameraError(f"Camera {self._source!r} delivers no more pictures: check its cable.")
        height, width = picture.shape[:2]
        if self._exact and self._asked != (width, height):
            wanted = " x ".join(map(str, self._asked))
            raise CameraError(
                f"Camera {self._source!r} delivers {width} x {height} pixels, its lens file holds for"
                f" {wanted}: set the camera to that, or make a lens file for this size (`calibrate --lens`)."
            )
        self._count += 1
        image = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)
        return Frame(self._clock.now(), self._count, image)

    def latest(self) -> Frame:
        """Return the newest picture; see `Camera`."""
        return self._reader.latest()

    def close(self) -> None:
        """Stop reading."""
        self._reader.close()
        self._capture.release()
