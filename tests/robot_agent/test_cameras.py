"""Cameras read in a thread: newest frames, ends, failures."""

import time

import cv2
import numpy as np
import pytest

from taskschema_robot.camera.camera import Frame
from taskschema_robot.camera.fetched_frame import FetchedFrame
from taskschema_robot.camera.reading_thread import ReadingThread
from taskschema_robot.camera.video_camera import VideoCamera
from taskschema_robot.clock import RealClock
from taskschema_robot.errors import CameraError


def test_a_video_camera_reads_to_its_end_and_keeps_the_last_frame(tmp_path):
    path = tmp_path / "frames.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, (64, 48))
    for index in range(20):
        picture = np.zeros((48, 64, 3), dtype=np.uint8)
        picture[:, :, 2] = 10 * index  # red, in OpenCV's order
        writer.write(picture)
    writer.release()
    clock = RealClock()
    before = clock.now()
    camera = VideoCamera(str(path), (64, 48), clock)
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

    frame = FetchedFrame(1.5, 7, fetch)
    assert (frame.time, frame.number, fetched) == (1.5, 7, [])
    assert frame.image.shape == (2, 2, 3)
    assert frame.image is frame.image
    assert fetched == [1]
    assert isinstance(frame, Frame)
