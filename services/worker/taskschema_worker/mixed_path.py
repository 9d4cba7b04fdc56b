"""The paths of a batch of arms that run different skills."""

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.motion import ArmPath


class MixedPath:
    """Paths of M arms that run different skills."""

    def __init__(self, count: int) -> None:
        self.duration: FloatArray = np.zeros(count)
        """[M] seconds until each path ends."""
        self.final_opening: FloatArray = np.zeros(count)
        """[M] gripper set-point at the end [m]."""
        self.final_joints: FloatArray = np.zeros((count, 7))
        """[M, 7] joint set-points at the end [rad]."""
        self._parts: list[tuple[IntArray, ArmPath]] = []

    def add(self, rows: IntArray, path: ArmPath) -> None:
        """Give the arms `rows` the paths in `path`, one each."""
        self.duration[rows] = path.duration
        self.final_opening[rows] = path.opening[:, -1]
        self.final_joints[rows] = path.joints[:, -1]
        self._parts.append((rows, path))

    def sample(
        self, times: FloatArray, arms: IntArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return joints, velocities and openings of the chosen arms, or all; see `ArmPath.sample`."""
        if arms is None:
            arms = np.arange(len(self.duration))
        shape = (len(arms), len(times))
        # In memory joints come first, as in what `ArmPath.sample` returns: whole rows are copied.
        joints, velocities = np.moveaxis(np.empty((2, 7, *shape)), 1, 3)
        opening = np.empty(shape)
        place = np.full(len(self.duration), -1)
        place[arms] = np.arange(len(arms))
        for rows, path in self._parts:
            chosen = np.flatnonzero(place[rows] >= 0)
            to = place[rows[chosen]]
            joints[to], velocities[to], opening[to] = path.sample(times, chosen)
        return joints, velocities, opening
