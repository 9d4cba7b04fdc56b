"""Tells a frozen camera from a scene in which nothing moved: simulation knows which of both it is."""

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray, IntArray
from taskschema.errors import FrameError
from taskschema.frames import Frames
from taskschema.visual_scene import OVERHEAD_HEIGHT, OVERHEAD_VIEW

VISIBLE_MOTION = 0.02
"""A hand or an object that moves further than this changes the picture [m]: it is six pixels."""
BORDER = 0.04
"""What moves so near to the edge of the picture, or beyond it, need not change it [m]."""


class CameraWatch:
    """Compares what is seen of each episode with what was seen of it last; one for each batch of episodes."""

    def __init__(self) -> None:
        self._last: dict[int, tuple[AnyArray, FloatArray]] = {}

    def look(self, episodes: IntArray, frames: Frames, places: FloatArray) -> None:
        """Take in what M episodes look like now.

        Args:
            episodes: [M] their numbers.
            frames: [M, 256, 256, 3]; kept, not copied.
            places: [M, K, 3] of the middles of hands and object, in the world frame [m].

        Raises:
            FrameError: if a frame is that of its episode before, to the bit, although something moved.

        """
        for index, episode in enumerate(episodes.tolist()):
            if episode in self._last:
                frame, before = self._last[episode]
                motion = visible_motion(before, places[index])
                if motion > VISIBLE_MOTION and np.array_equal(frame, frames[index]):
                    raise FrameError(
                        f"frame {index} is the same as the one before, although hand or object moved by "
                        f"{100 * motion:.0f} cm: the camera is frozen"
                    )
            self._last[episode] = frames[index], places[index]


def visible_motion(before: FloatArray, after: FloatArray) -> float:
    """Return how far the places [K, 3] went that the overhead camera saw before or sees after [m]."""
    seen = _in_view(before) | _in_view(after)
    return float(np.linalg.norm(after - before, axis=1).max(where=seen, initial=0.0))


def _in_view(places: FloatArray) -> BoolArray:
    half: FloatArray = 0.5 * OVERHEAD_VIEW * (1.0 - places[:, 2] / OVERHEAD_HEIGHT) - BORDER
    return np.asarray((np.abs(places[:, :2]) < half[:, None]).all(axis=1))
