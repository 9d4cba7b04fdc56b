"""The object as a camera sees it: which frames count, what a reset shows, turns that are followed."""

import os
from functools import cache

import numpy as np
import pytest
from marker_scene import INTRINSICS, picture_of, standing
from recording_arms import SteppedClock

from taskschema.tasks import get_task
from taskschema_robot.agent.kept_files import KeptFiles
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.camera.camera import Frame
from taskschema_robot.errors import CameraError
from taskschema_robot.objects.catalogue import HEAVY_BAR, SOCCER_BALL, T_WRENCH, WATER_BOTTLE
from taskschema_robot.reward.camera_world import CameraWorld
from taskschema_robot.reward.following import FOLLOW_SECONDS, FollowingMonitor, FollowingThread
from taskschema_robot.reward.judge import LEAST_FRAMES, Outcome
from taskschema_robot.reward.tracker import ObjectTracker


@cache
def picture(item, yaw: float, angle: float) -> np.ndarray:
    return picture_of(item, standing(item, yaw=yaw), np.deg2rad(angle)).image


class Scene:
    """A camera above an object that stands in the middle, and the person who puts it back."""

    def __init__(self, item, folder, yaw: float | None = None, angle: float = 0.0) -> None:
        self.item, self.clock = item, SteppedClock()
        self.yaw, self.angle = item.yaw if yaw is None else yaw, angle
        self.problems: list[str] = []
        self.frozen: Frame | None = None
        self._count = 0
        self.task = get_task(item.family.replace("_", "-"))
        tracker = ObjectTracker(item, INTRINSICS)
        self.world = CameraWorld(self, tracker, self.task, item, self, self.clock, folder)

    def latest(self) -> Frame:
        self._count += 1
        return self.frozen or Frame(self.clock.now(), self._count, picture(self.item, self.yaw, self.angle))

    def ask_reset(self, item, wanted, problem) -> None:
        self.problems.append(problem)

    def reset(self) -> np.ndarray:
        instance = self.task.draw_instance(np.random.default_rng(0))
        object.__setattr__(instance, "position", (0.0, 0.0, 0.0))
        return self.world.reset(instance)

    def turn(self, angles: np.ndarray, *, followed: bool) -> None:
        monitor = FollowingMonitor(self.world.follow)
        for angle in angles:
            self.angle = float(angle)
            self.clock.sleep_until(self.clock.now() + FOLLOW_SECONDS)
            assert not followed or monitor.fault(self.clock.now()) is None


@pytest.mark.parametrize(
    ("item", "yaw", "angle", "problem"),
    [
        (HEAVY_BAR, HEAVY_BAR.yaw + 0.1, 0, None),
        (HEAVY_BAR, HEAVY_BAR.yaw + np.pi, 0, "it is turned by [+-]180 degrees"),
        (HEAVY_BAR, 0.0, 0, "it is turned by -45 degrees"),
        (SOCCER_BALL, 1.0, 0, None),
        (WATER_BOTTLE, 2.0, 5, None),
        (WATER_BOTTLE, 0.0, 90, "was not turned back: it stands at [+]90 degrees"),
        (T_WRENCH, 0.0, 180, "was not turned back: it stands at [+-]180 degrees"),
        (T_WRENCH, 1.0, 0, "it is turned by [+]57 degrees"),
    ],
)
def test_a_reset_shows_the_object_as_it_was_asked_for(tmp_path, item, yaw, angle, problem):
    scene = Scene(item, tmp_path, yaw, angle)
    if problem is None:
        pose = scene.reset()
        assert scene.problems == [""]
        assert pose[7:] == pytest.approx([0.0] * len(pose[7:]), abs=0.05)
        return
    with pytest.raises(EpisodeDroppedError, match=problem):
        scene.reset()


def test_a_picture_from_before_does_not_count(tmp_path):
    scene = Scene(HEAVY_BAR, tmp_path)
    start = scene.reset()
    scene.frozen = scene.latest()
    scene.clock.sleep_until(scene.clock.now() + 0.5)
    judgement = scene.world.judge(start, "0")
    assert judgement.outcome is Outcome.UNKNOWN
    assert judgement.reason == f"0 new pictures came, {LEAST_FRAMES} are needed"


def test_a_second_session_in_a_folder_overwrites_no_picture_of_the_first(tmp_path):
    kept = []
    for yaw in (0.0, 2.0):
        scene = Scene(WATER_BOTTLE, tmp_path, yaw)
        start = scene.reset()
        judgements = [scene.world.judge(start, "000003-000007-0-0"), scene.world.last_look(start, "end")]
        kept += [(tmp_path / judgement.picture).read_bytes() for judgement in judgements]
    assert {path.name for path in tmp_path.iterdir()} == {
        "000003-000007-0-0-failure.png",
        "000003-000007-0-0-failure-2.png",
        "end-failure.png",
        "end-failure-2.png",
    }
    assert {path.read_bytes() for path in tmp_path.iterdir()} == set(kept)


def test_the_oldest_pictures_go_those_of_earlier_sessions_first(tmp_path):
    for session in range(2):
        files = KeptFiles(tmp_path, ".png", 3)
        for number in range(2):
            path = files.place(f"{session}-{number}")
            path.touch()
            os.utime(path, ns=(0, session * 2 + number))
    assert {path.name for path in tmp_path.iterdir()} == {"0-1.png", "1-0.png", "1-1.png"}


@pytest.mark.parametrize(
    ("angle", "followed", "expected"),
    [
        (-100, True, Outcome.FAILURE),
        (-100, False, Outcome.UNKNOWN),
        (200, True, Outcome.SUCCESS),
        (350, True, Outcome.SUCCESS),
    ],
)
def test_a_turn_is_followed_during_motions(tmp_path, angle, followed, expected):
    scene = Scene(T_WRENCH, tmp_path)
    start = scene.reset()
    scene.turn(np.linspace(0, angle, 6), followed=followed)
    assert scene.world.judge(start, "0").outcome is expected


def test_a_thread_follows_beside_the_motion_whatever_the_camera_does():
    looks: list[int] = []

    def follow() -> None:
        looks.append(1)
        raise CameraError("no picture")

    with FollowingThread(follow) as thread:
        while len(looks) < 2:
            thread._ending.wait(0.01)
    before = len(looks)
    thread._ending.wait(0.01)
    assert len(looks) == before
