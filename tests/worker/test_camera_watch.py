"""A frozen camera is told from what stands still, and from what moves where it does not look."""

import numpy as np
import pytest

from taskschema.errors import FrameError
from taskschema_worker.camera_watch import CameraWatch, visible_motion

PLACES = np.array([[[0.0, -0.2, 0.14], [0.0, 0.2, 0.14], [0.05, 0.0, 0.03]]])
"""Hands and object of one episode [m]."""
EPISODE = np.array([7])


def moved(index, shift):
    places = PLACES.copy()
    places[0, index] += shift
    return places


def frame(value=100):
    return np.full((1, 256, 256, 3), value, dtype=np.uint8)


@pytest.mark.parametrize(
    ("index", "shift", "motion"),
    [
        (0, (0.03, 0.0, 0.04), 0.05),
        (2, (0.0, 0.021, 0.0), 0.021),
        (1, (0.0, 0.0, 0.0), 0.0),
        (1, (0.0, 0.5, 0.0), 0.5),  # out of the picture, where it was
    ],
)
def test_motion_is_that_of_whatever_went_furthest(index, shift, motion):
    assert visible_motion(PLACES[0], moved(index, shift)[0]) == pytest.approx(motion)


def test_what_is_outside_the_picture_before_and_after_is_not_seen():
    """At a height of 0.625 m, half the camera's, its picture is half as wide: +-0.2 m, less a border."""
    outside = moved(0, (0.18, 0.2, 0.485))
    for shift, motion in (((0.05, 0.0, 0.0), 0.0), ((-0.05, 0.0, 0.0), 0.05)):
        after = outside.copy()
        after[0, 0] += shift
        assert visible_motion(outside[0], after[0]) == pytest.approx(motion)


def test_only_the_same_frame_of_what_moved_is_refused():
    for places, picture, frozen in (
        (moved(2, 0.02), frame(), True),
        (moved(2, 0.02), frame(101), False),
        (moved(2, 0.01), frame(), False),
        (PLACES, frame(), False),
        (np.full_like(PLACES, np.nan), frame(), False),  # the simulation broke down
    ):
        watch = CameraWatch()
        watch.look(EPISODE, frame(), PLACES)
        watch.look(EPISODE + 1, frame(), moved(2, 0.1))  # another episode
        if frozen:
            with pytest.raises(
                FrameError, match=r"^frame 0 is the same .* moved by 3 cm: the camera is frozen$"
            ):
                watch.look(EPISODE, picture, places)
        else:
            watch.look(EPISODE, picture, places)


def test_each_frame_is_compared_with_the_one_before_it():
    watch = CameraWatch()
    for shift in (0.0, 0.01, 0.02, 0.03):  # 1.7 cm each
        watch.look(EPISODE, frame(), moved(0, shift))
    with pytest.raises(FrameError):
        watch.look(EPISODE, frame(), moved(0, 0.05))
