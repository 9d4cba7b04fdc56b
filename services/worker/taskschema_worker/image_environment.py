"""An environment whose observations are frames of the overhead camera, and nothing else."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.frames import FRAME_SHAPE, Frames, check_colour_order, check_frames
from taskschema.tasks.table_arguments import offset_arguments
from taskschema.tasks.task import SeenEnvironment, StepResult, Task


class ImageEnvironment:
    """N episodes seen from above; see `BatchEnvironment`.

    Observations are frames [N, 256, 256, 3]: no pose, no timestep. Arguments are those of
    `Task.image_pairs`; skills are planned from the same places as offsets from the object, so that simulation
    and skills are those of the state environment, to the bit.
    """

    def __init__(self, task: Task, environment: SeenEnvironment) -> None:
        self._task = task
        self._environment = environment
        self._steps: IntArray = np.empty(0, dtype=np.int64)
        self.sees_the_end = False
        """Whether to look at episodes that are over, too: nobody acts there, and rendering takes most of the
        time. Where it is not done, the frame is black."""

    def reset(self, generators: Sequence[np.random.Generator]) -> Frames:
        """Start one episode per generator and return what is seen.

        Raises:
            FrameError: if a frame cannot come from a working camera.
        """
        self._environment.reset(generators)
        self._steps = np.zeros(len(generators), dtype=np.int64)
        frames = self._see(np.arange(len(generators)))
        check_colour_order(frames)
        return frames

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        """Run one step of the episodes [M], with SI arguments [M, A] on the table."""
        anchors = self._environment.pose_anchors(episodes)
        result = self._environment.step(episodes, pairs, offset_arguments(self._task, arguments, anchors))
        self._steps[episodes] += 1
        over = result.success | result.diverged | (self._steps[episodes] >= self._task.horizon)
        seen = np.flatnonzero(~over | self.sees_the_end)
        frames = np.zeros((len(episodes), *FRAME_SHAPE), dtype=np.uint8)
        if len(seen):
            frames[seen] = self._see(episodes[seen])
        return dataclasses.replace(result, observations=frames)

    def close(self) -> None:
        """Free threads and memory."""
        self._environment.close()

    def _see(self, episodes: IntArray) -> Frames:
        frames = self._environment.frames(episodes)
        check_frames(frames)
        return frames
