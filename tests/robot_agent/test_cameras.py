"""Cameras read in a thread: newest frames, ends, failures."""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from taskschema_robot.camera.camera import Frame
from taskschema_robot.camera.fetched_frame import FetchedFrame
from taskschema_robot.camera.reading_thread import ReadingThread
from taskschema_robot.camera.video_camera import VideoCamera
from taskschema_robot.clock import RealClock
from taskschema_robot.errors import CameraError


def film(path: Path) -> str:
    """Write 20 frames of 64 x 48 pixels."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, (64, 48))
    for index in range(20):
        picture = np.zeros((48, 64, 3), dtype=np.uint8)
        picture[:, :, 2] = 10 * index  # red, in OpenCV's order
        writer.write(picture)
    writer.release()
    return str(path)


def test_a_video_camera_reads_to_its_end_and_keeps_the_last_frame(tmp_path):
    path = film(tmp_path / "frames.avi")
    clock = RealClock()
    before = clock.now()
    camera = VideoCamera(path, (64, 48), clock)
    try:
        deadline = time.monotonic() + 10
        while camera.latest().number < 20:
            assert time.monotonic() < deadline
        frame = camera.latest()
    finally:
        camera.close()
    assert frame.image.shape == (48, 64, 3)
    assert abs(int(frame.image[24, 32, 0]) - 190) < 12  # red comes first here
    assert frame.image[24, 32, 2] < 30
    assert before < frame.time < clock.now()


def test_pictures_of_another_size_than_the_lens_files_are_refused(tmp_path):
    path = film(tmp_path / "frames.avi")
    camera = VideoCamera(path, (128, 96), RealClock())
    with pytest.raises(CameraError, match="delivers 64 x 48 pixels, its lens file holds for 128 x 96"):
        camera.latest()
    camera.close()
    any_size = VideoCamera(path, (128, 96), RealClock(), exact=False)  # to find out about its lens
    assert any_size.latest().image.shape == (48, 64, 3)
    any_size.close()


def test_a_digest_tells_pictures_apart():
    image = np.zeros((48, 64, 3), dtype=np.uint8)
    first = Frame(0.0, 0, image)
    other = image.copy()
    other[47, 63, 2] = 1
    assert Frame(1.0, 1, image.copy()).digest == first.digest
    assert Frame(1.0, 1, other).digest != first.digest


def test_a_camera_that_is_not_there():
    with pytest.raises(CameraError, match="cannot be opened"):
        VideoCamera("/no/such/camera", (640, 480), RealClock())


def test_a_source_without_any_frame_says_why():
    def read() -> Frame:
        raise CameraError("Camera 'x' delivers no more pictures: check its cable.")

    reader = ReadingThread(read, "x")
    with pytest.raises(CameraError, match="no more pictures"):
        reader.latest()
    reader.close()


def test_a_fetched_frame_fetches_once_and_only_if_looked_at():
    fetched = []

    def fetch() -> np.ndarray:
        fetched.append(1)
        return np.zeros((2, 2, 3), dtype=np.uint8)

    frame = FetchedFrame(1.5, 7, 9, fetch)
    assert (frame.time, frame.number, frame.digest, fetched) == (1.5, 7, 9, [])
    assert frame.image.shape == (2, 2, 3)
    assert frame.image is frame.image
    assert fetched == [1]
    assert isinstance(frame, Frame)
