"""What has to be well beside the arms before the first day: the camera's picture, Redis and the run."""

from collections.abc import Sequence

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema.bus.url import without_secrets
from taskschema.errors import TaskschemaError
from taskschema_robot.camera.camera import Camera, Frame, Intrinsics
from taskschema_robot.clock import Clock
from taskschema_robot.errors import CameraError
from taskschema_robot.finding import Finding
from taskschema_robot.reward.calibration import check_view

FRAMES = 5
"""Pictures that are looked at."""
FRAME_SECONDS = 5.0
"""How long they may take to come [s]."""


def look_through(camera: Camera, intrinsics: Intrinsics, clock: Clock) -> Sequence[Finding]:
    """Return whether new pictures come and what they show of the table's markers."""
    frames: list[Frame] = []
    begin = clock.now()
    try:
        while len(frames) < FRAMES and clock.now() < begin + FRAME_SECONDS:
            frame = camera.latest()
            if not frames or frame.number != frames[-1].number:
                _ = frame.image.shape  # a twin's is fetched now, or not at all
                frames.append(frame)
            clock.sleep_until(clock.now() + 0.02)
    except CameraError as error:
        return [Finding("camera picture", False, str(error))]
    if len(frames) < FRAMES:
        words = f"{len(frames)} new ones in {FRAME_SECONDS:.0f} s: check its cable, and who else uses it"
        return [Finding("camera picture", False, words)]
    height, width, _ = frames[-1].image.shape
    return [
        Finding("camera picture", True, f"{width} x {height} pixels"),
        *check_view(frames, intrinsics, None),
    ]


def look_for_run(url: str, run: str) -> Sequence[Finding]:
    """Return whether a Redis answers and knows a run for robots that goes on."""
    place = f"Redis at {without_secrets(url)}"
    try:
        records = RunRecords(connect(url, patience=0.0))
        records.ping()
    except TaskschemaError as error:
        return [Finding(place, False, str(error))]
    try:
        config, status = records.config(run), records.status(run)
    except TaskschemaError as error:
        return [Finding(place, True, "answers"), Finding(f"run {run}", False, str(error))]
    for_robots = config.episodes_per_slot == 1
    words = f"{config.task}, {status.state}, round {status.round}"
    if not for_robots:
        words += ": start it with `taskschema train --agent robot`"
    return [Finding(place, True, "answers"), Finding(f"run {run}", for_robots, words)]
