"""Where cameras are opened, and what they look for."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from taskschema.arrays import FloatArray
from taskschema.errors import ConfigError
from taskschema.tasks.scene_task import SceneTask
from taskschema_robot.agent.frame_observer import FrameObserver
from taskschema_robot.camera.camera import Camera, Intrinsics
from taskschema_robot.camera.video_camera import VideoCamera
from taskschema_robot.cli.arms import Hardware
from taskschema_robot.clock import Clock
from taskschema_robot.reward.lens_file import read_lens
from taskschema_robot.reward.overhead import overhead_view
from taskschema_robot.twin.camera import LockStepCamera, TwinCamera
from taskschema_robot.twin.lock_step import LockStepClock
from taskschema_robot.twin.scene import intrinsics


@dataclass(frozen=True)
class Eyes:
    """A camera and how it projects."""

    camera: Camera
    intrinsics: Intrinsics


def open_eyes(stack: ExitStack, hardware: Hardware, source: str | None, lens: Path | None) -> Eyes:
    """Open the overhead camera: a twin's own, or the one named.

    Raises:
        ConfigError: if robots have no camera named; CameraError, if it cannot be opened.

    """
    camera: Camera
    if hardware.twin is not None:
        if isinstance(hardware.clock, LockStepClock):
            camera = LockStepCamera(hardware.twin, hardware.clock)
        else:
            camera = TwinCamera(hardware.twin.url, hardware.clock)
        projection = intrinsics()
    else:
        if source is None or lens is None:
            raise ConfigError("Robots need eyes: --camera SOURCE and --lens FILE (see `calibrate`).")
        projection, size = read_lens(lens)
        camera = VideoCamera(source, size, hardware.clock)
    stack.callback(camera.close)
    camera.latest()  # one that has no picture, or one of another size, is better known of now
    return Eyes(camera, projection)


def frame_observer(task: SceneTask, size: FloatArray, eyes: Eyes, clock: Clock) -> FrameObserver:
    """Return what policies on images observe.

    Raises:
        CameraError: if the table's markers are not seen.

    """
    view = overhead_view(eyes.camera, eyes.intrinsics, task.table_view, clock)
    return FrameObserver(task, size, eyes.camera, view, clock)
