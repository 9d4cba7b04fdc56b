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
        self._parts: list[tuple[IntArray, ArmPath]] = []

    def add(self, rows: IntArray, path: ArmPath) -> None:
        """Give the episodes `rows` the paths in `path`, one each."""
        self.duration[rows] = path.duration
        self.final_opening[rows] = path.opening[:, -1]
        self._parts.append((rows, path))

    def sample(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return joints, velocities and openings of all episodes at `times`; see `ArmPath.sample`."""
        shape = (len(self.duration), len(times))
        joints, velocities, opening = np.empty((*shape, 7)), np.empty((*shape, 7)), np.empty(shape)
        for rows, path in self._parts:
            joints[rows], velocities[rows], opening[rows] = path.sample(times)
        return joints, velocities, opening
