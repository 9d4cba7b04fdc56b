"""Cameras read in a thread: newest frames, ends, failures."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest
from rendering_setup import needs_renderer
from twin_setup import RunningTwin

from taskschema.safety.limits import SafetyLimits
from taskschema_robot.camera.camera import Camera, Frame
from taskschema_robot.camera.fetched_frame import FetchedFrame
from taskschema_robot.camera.reading_thread import ReadingThread
from taskschema_robot.camera.video_camera import VideoCamera
from taskschema_robot.clock import RealClock
from taskschema_robot.errors import CameraError
from taskschema_robot.safety.monitors import CameraMonitor
from taskschema_robot.twin.camera import TwinCamera
from taskschema_robot.twin.twin import TwinOptions


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

    reader = ReadingThread(read, lambda: None, "x")
    with pytest.raises(CameraError, match="no more pictures"):
        reader.latest()
    reader.close()


class Stream(BaseHTTPRequestHandler):
    """An address that shows numbered pictures for as long as its server runs, as network cameras do."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=next")
        self.end_headers()
        number = 0
        while not self.server.ending.wait(0.02):
            number += 1
            _, jpeg = cv2.imencode(".jpg", np.full((48, 64, 3), number % 250, dtype=np.uint8))
            head = f"--next\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            self.wfile.write(head.encode() + jpeg.tobytes() + b"\r\n")

    def log_message(self, *unused: object) -> None:
        """Be quiet."""


@contextmanager
def streaming(port: int = 0) -> Iterator[int]:
    """Stream pictures at a port of this machine."""
    with ThreadingHTTPServer(("127.0.0.1", port), Stream) as server:
        server.ending = threading.Event()
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server.server_address[1]
        finally:
            server.ending.set()
            server.shutdown()
            thread.join()


@contextmanager
def twin_at(port: int = 0) -> Iterator[int]:
    """Run a twin whose control server is at a port of this machine, and whose time is far behind."""
    twin = RunningTwin(TwinOptions(epoch=time.time() - 100.0), control=port)
    try:
        yield int(twin.control_url.rpartition(":")[2])
    finally:
        twin.close()


def video_camera(port: int) -> Camera:
    return VideoCamera(f"http://127.0.0.1:{port}/", (64, 48), RealClock())


def twin_camera(port: int) -> Camera:
    return TwinCamera(f"ws://127.0.0.1:{port}", RealClock())


def wait_until(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 40
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("source", "look"),
    [
        pytest.param(streaming, video_camera, id="video"),
        pytest.param(twin_at, twin_camera, id="twin", marks=needs_renderer),
    ],
)
def test_a_camera_that_was_gone_comes_back_and_its_age_was_a_fault_meanwhile(source, look):
    """Cable out, cable in: the address is the same."""
    clock = RealClock()
    with source() as port:
        camera = look(port)
        monitor = CameraMonitor(camera, SafetyLimits().camera_age)
        wait_until(lambda: monitor.fault(clock.now()) is None)
    wait_until(lambda: monitor.fault(clock.now()) is not None)
    assert "camera's last picture is" in monitor.fault(clock.now()).reason
    gone = camera.latest()
    time.sleep(0.2)
    assert camera.latest() is gone
    with source(port):
        wait_until(lambda: camera.latest().time > gone.time)
        wait_until(lambda: monitor.fault(clock.now()) is None)
        camera.close()


def test_a_source_is_opened_again_with_growing_pauses(monkeypatch):
    monkeypatch.setattr("taskschema_robot.camera.reading_thread.FIRST_PAUSE", 0.01)
    monkeypatch.setattr("taskschema_robot.camera.reading_thread.LONGEST_PAUSE", 0.04)
    opened: list[float] = []
    seen: list[Frame] = []

    def reopen() -> None:
        opened.append(time.monotonic())
        if len(opened) < 6:
            raise CameraError("It is not there.")

    def read() -> Frame:
        time.sleep(0.001)
        if seen and not opened:
            raise CameraError("It is gone.")
        seen.append(Frame(0.0, len(opened), np.zeros((2, 2, 3), dtype=np.uint8)))
        return seen[-1]

    reader = ReadingThread(read, reopen, "x")
    wait_until(lambda: reader.latest().number == 6)
    reader.close()
    assert len(opened) == 6, "it was opened again although it worked"
    pauses = np.diff(opened)
    assert (pauses >= np.array([0.02, 0.04, 0.04, 0.04, 0.04]) - 1e-3).all()


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
