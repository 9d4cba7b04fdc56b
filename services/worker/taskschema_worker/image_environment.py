"""An environment whose observations are frames of the overhead camera, and nothing else."""

from collections.abc import Sequence

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.frames import Frames, check_colour_order, check_frames
from taskschema.skills.table_space import LOCATION, OWN_HEIGHT
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

    def reset(self, generators: Sequence[np.random.Generator]) -> Frames:
        """Start one episode per generator and return what is seen.

        Raises:
            FrameError: if a frame cannot come from a working camera.
        """
        self._environment.reset(generators)
        frames = self._see(np.arange(len(generators)))
        check_colour_order(frames)
        return frames

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        """Run one step of the episodes [M], with SI arguments [M, A] on the table."""
        anchors = self._environment.pose_anchors(episodes)
        result = self._environment.step(episodes, pairs, offset_arguments(self._task, arguments, anchors))
        # An episode that is over is not looked at again: rendering is most of the time.
        frames = np.zeros((len(episodes), *self._shape), dtype=np.uint8)
        seen = np.flatnonzero(~(result.success | result.diverged))
        frames[seen] = self._see(episodes[seen])
        return StepResult(frames, result.success, result.diverged, result.physics_steps)

    def close(self) -> None:
        """Free threads and memory."""
        self._environment.close()

    def _see(self, episodes: IntArray) -> Frames:
        frames = self._environment.frames(episodes)
        check_frames(frames)
        self._shape = frames.shape[1:]
        return frames


def offset_arguments(task: Task, arguments: FloatArray, anchors: FloatArray) -> FloatArray:
    """Return what skills take, [M, A'], from arguments [M, A] of `task.image_pairs`.

    Args:
        task: whose skills they are.
        arguments: SI units; locations in the world frame.
        anchors: [M, 3] see `SeenEnvironment.pose_anchors`.
    """
    table = task.image_pairs.argument_names
    columns = []
    for name in task.pairs.argument_names:
        argument = name.rpartition(".")[2]
        if argument == OWN_HEIGHT:
            columns.append(anchors[:, 2])
        elif argument in LOCATION:
            columns.append(arguments[:, table.index(name)] - anchors[:, LOCATION.index(argument)])
        else:
            columns.append(arguments[:, table.index(name)])
    return np.stack(columns, axis=1)
