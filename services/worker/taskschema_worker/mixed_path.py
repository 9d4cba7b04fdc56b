"""One arm's paths in a batch of episodes that run different skills."""

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.motion import ArmPath


class MixedPath:
    """One arm's paths for M episodes that run different skills."""

    def __init__(self, count: int) -> None:
        self.duration: FloatArray = np.zeros(count)
        """[M] seconds until each path ends."""
        self.final_opening: FloatArray = np.zeros(count)
        """[M] gripper set-point at the end [m]."""
        self._parts: list[ArmPath] = []
        self._part: IntArray = np.zeros(count, dtype=np.int64)
        self._row: IntArray = np.zeros(count, dtype=np.int64)

    def add(self, rows: IntArray, path: ArmPath) -> None:
        """Give the episodes `rows` the paths in `path`, one each."""
        self.duration[rows] = path.duration
        self.final_opening[rows] = path.opening[:, -1]
        self._part[rows] = len(self._parts)
        self._row[rows] = np.arange(len(rows))
        self._parts.append(path)

    def sample(self, rows: IntArray, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return joints, velocities and openings of `rows` at `times`; see `ArmPath.sample`."""
        shape = (len(rows), len(times))
        joints, velocities, opening = np.empty((*shape, 7)), np.empty((*shape, 7)), np.empty(shape)
        for index, path in enumerate(self._parts):
            here = np.flatnonzero(self._part[rows] == index)
            if len(here):
                sampled = path.rows(self._row[rows[here]]).sample(times)
                joints[here], velocities[here], opening[here] = sampled
        return joints, velocities, opening
