"""The reward from markers, against pictures whose truth is known."""

import cv2
import numpy as np
import pytest
from marker_scene import FROM_ABOVE, INTRINSICS, picture_of, standing

from taskschema.tasks import get_task
from taskschema_robot.agent.kept_files import KeptFiles
from taskschema_robot.camera.camera import Frame
from taskschema_robot.objects.catalogue import OBJECTS, get_object
from taskschema_robot.objects.marker import TABLE_MARKERS
from taskschema_robot.reward.judge import LEAST_FRAMES, Outcome, judge, keep_evidence
from taskschema_robot.reward.poses import Pose
from taskschema_robot.reward.tracker import ObjectTracker

BAR, JAR, WRENCH, BALL = (get_object(name) for name in ("heavy-bar", "glass-jar", "t-wrench", "soccer-ball"))


def tracker(item) -> ObjectTracker:
    return ObjectTracker(item, INTRINSICS)


def sightings(item, pose, angle=0.0, *, eyes=None, count=8, begin=0.0, **kwargs):
    eyes = eyes or tracker(item)
    return [
        eyes.see(picture_of(item, pose, angle, time=begin + 0.03 * n, seed=n, **kwargs)) for n in range(count)
    ]


@pytest.mark.parametrize("item", OBJECTS.values(), ids=OBJECTS)
def test_every_object_is_found_where_it_is(item):
    truth = standing(item, 0.03, -0.05, item.yaw + 0.1)
    sighting = tracker(item).see(picture_of(item, truth))
    assert sighting.pose is not None, sighting.reason
    np.testing.assert_allclose(sighting.pose[:3], truth.position, atol=0.012)
    cosine = np.abs(
        sighting.pose[3] * np.cos((item.yaw + 0.1) / 2) + sighting.pose[6] * np.sin((item.yaw + 0.1) / 2)
    )
    assert 2 * np.arccos(min(cosine, 1.0)) < 0.15


def outcome(task, item, start, end, angle=0.0, **kwargs):
    eyes = tracker(item)
    begin = sightings(item, start, eyes=eyes, count=1)[0].pose
    return judge(get_task(task), begin, sightings(item, end, angle, eyes=eyes, begin=5.0, **kwargs))


@pytest.mark.parametrize(
    ("height", "tilt", "expected"),
    [
        (0.28, 0.0, Outcome.SUCCESS),
        (0.20, 0.0, Outcome.FAILURE),
        (0.0, 0.0, Outcome.FAILURE),
        (0.30, 0.35, Outcome.FAILURE),
        (0.30, 0.1, Outcome.SUCCESS),
    ],
)
def test_lateral_lifting(height, tilt, expected):
    start, end = standing(BAR, yaw=BAR.yaw), standing(BAR, 0.02, 0.01, BAR.yaw, height)
    turn, _ = cv2.Rodrigues(np.array([0.0, tilt, 0.0]))
    assert outcome("lateral-lifting", BAR, start, Pose(end.position, end.rotation @ turn)).outcome is expected


@pytest.mark.parametrize(
    ("angle", "shift", "expected"),
    [
        (np.deg2rad(100), 0.0, Outcome.SUCCESS),
        (np.deg2rad(80), 0.0, Outcome.FAILURE),
        (np.deg2rad(100), 0.08, Outcome.FAILURE),
        (0.0, 0.0, Outcome.FAILURE),
    ],
)
def test_opening(angle, shift, expected):
    assert outcome("opening", JAR, standing(JAR), standing(JAR, shift), angle).outcome is expected


def test_rotating_past_half_a_turn_is_followed():
    eyes, start = tracker(WRENCH), standing(WRENCH)
    begin = sightings(WRENCH, start, eyes=eyes, count=1)[0].pose
    for step, angle in enumerate(np.linspace(0.0, np.deg2rad(190), 8)):
        last = sightings(WRENCH, start, angle, eyes=eyes, count=1, begin=0.1 * (step + 1))[0]
    assert last.pose[7] == pytest.approx(np.deg2rad(190), abs=0.05)
    settled = sightings(WRENCH, start, np.deg2rad(190), eyes=eyes, begin=3.0)
    assert judge(get_task("rotating"), begin, settled).outcome is Outcome.SUCCESS


@pytest.mark.parametrize(
    ("angle", "expected"),
    [
        (185, Outcome.UNKNOWN),  # or 175 backwards
        (-100, Outcome.UNKNOWN),  # or 260 forwards
        (170, Outcome.FAILURE),
        (-20, Outcome.FAILURE),
    ],
)
def test_a_turn_that_nobody_saw_is_unknown_where_it_matters(angle, expected):
    judgement = outcome("rotating", WRENCH, standing(WRENCH), standing(WRENCH), np.deg2rad(angle))
    assert judgement.outcome is expected
    assert expected is Outcome.FAILURE or "which way" in judgement.reason


@pytest.mark.parametrize(
    ("height", "expected"), [(0.28, Outcome.SUCCESS), (0.20, Outcome.FAILURE), (0.0, Outcome.FAILURE)]
)
def test_picking(height, expected):
    rolled = standing(BALL, 0.02, -0.01, 0.5, height)  # between two hands a ball turns
    assert outcome("picking", BALL, standing(BALL), rolled).outcome is expected


def test_a_ball_that_hands_hide_is_unknown():
    hidden = tuple(marker.number for marker in BALL.markers)
    judgement = outcome("picking", BALL, standing(BALL), standing(BALL, height=0.3), hidden=hidden)
    assert judgement.outcome is Outcome.UNKNOWN
    assert "none of its markers" in judgement.reason


def test_the_balls_height():
    start, end = standing(BALL), standing(BALL, 0.02, 0.0, 0.5, 0.3)
    before, after = (sightings(BALL, pose, count=1)[0].pose for pose in (start, end))
    assert after[2] - before[2] == pytest.approx(0.3, abs=0.015)


def test_what_is_hidden_is_unknown_never_a_failure():
    start = standing(JAR)
    lid = tuple(marker.number for marker in JAR.joint_markers)
    assert outcome("opening", JAR, start, start, hidden=lid).outcome is Outcome.UNKNOWN
    base = tuple(marker.number for marker in JAR.markers)
    judgement = outcome("opening", JAR, start, start, hidden=base)
    assert judgement.outcome is Outcome.UNKNOWN
    assert "13" in judgement.reason


def test_too_few_table_markers_are_unknown():
    hidden = tuple(TABLE_MARKERS)[:3]
    place = standing(BAR, yaw=BAR.yaw)
    judgement = outcome("lateral-lifting", BAR, place, place, hidden=hidden)
    assert judgement.outcome is Outcome.UNKNOWN
    assert "3 of the table's 6 markers" in judgement.reason


def test_a_bumped_camera_changes_nothing():
    bumped = Pose(
        FROM_ABOVE.position + [0.03, 0.02, -0.03],
        cv2.Rodrigues(np.array([0.03, 0.02, 0.05]))[0] @ FROM_ABOVE.rotation,
    )
    truth = standing(BAR, 0.02, 0.03, BAR.yaw)
    before = tracker(BAR).see(picture_of(BAR, truth)).pose
    after = tracker(BAR).see(picture_of(BAR, truth, camera=bumped)).pose
    np.testing.assert_allclose(after[:3], before[:3], atol=0.01)


def test_an_object_in_motion_is_unknown():
    eyes = tracker(BAR)
    moving = [eyes.see(picture_of(BAR, standing(BAR, 0.01 * n), time=0.03 * n, seed=n)) for n in range(8)]
    start = moving[0].pose
    assert judge(get_task("lateral-lifting"), start, moving).outcome is Outcome.UNKNOWN


def test_too_few_pictures_are_unknown():
    eyes, place = tracker(BAR), standing(BAR, yaw=BAR.yaw)
    seen = sightings(BAR, place, eyes=eyes, count=LEAST_FRAMES)
    task = get_task("lateral-lifting")
    assert judge(task, seen[0].pose, seen).outcome is Outcome.FAILURE
    assert judge(task, seen[0].pose, seen[1:]).outcome is Outcome.UNKNOWN


def test_no_picture_is_unknown():
    assert judge(get_task("opening"), np.zeros(8), []).outcome is Outcome.UNKNOWN
    empty = tracker(BAR).see(Frame(0.0, 0, np.full((1080, 1920, 3), 128, dtype=np.uint8)))
    assert empty.pose is None


def test_the_evidence_is_kept(tmp_path):
    judgement = outcome("opening", JAR, standing(JAR), standing(JAR))
    kept_as = keep_evidence(judgement, KeptFiles(tmp_path / "evidence", ".png", 1), "0").picture
    assert kept_as == "0-failure.png"
    kept = cv2.imread(str(tmp_path / "evidence" / kept_as))
    assert kept.shape == (1080, 1920, 3)
    assert (kept[..., 1].astype(int) - kept[..., 0] > 100).any(), "no outlines"
