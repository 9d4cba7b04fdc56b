"""Which parts of a scene a fixed camera can see: drawing the others takes a third of the time."""

import itertools

import mujoco
import numpy as np

from taskschema.arrays import BoolArray, FloatArray
from taskschema.visual_scene import HIDDEN_GROUP, TABLE_EDGE, TABLE_THICKNESS

SIGNS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
"""[8, 3] corners of a box."""
TABLE_FILLS = 0.5 * TABLE_EDGE + 1e-3
"""Half the table's edge [m], and less than half a pixel more: a view up to here shows nothing below it."""


class SeenGeoms:
    """Hides geoms whose bounding boxes are outside what a fixed camera sees; the picture stays the same.

    Below a table that fills the view nothing is drawn either. It holds without shadows and reflections:
    those come from outside the view, too.

    Args:
        model: the compiled scene, as it stays.
        camera: number of the camera; the frame is square.

    """

    def __init__(self, model: mujoco.MjModel, camera: int) -> None:
        self._groups = model.geom_group.copy()
        self._endless = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        self._camera = camera

    def hide_others(self, instance: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write the groups of a copy of the model, after its kinematics and cameras were computed."""
        corners = self._corners(instance, data)
        hidden = self._outside(instance, data, corners)
        if self._table_fills_the_view(instance, data):
            highest = np.where(self._endless, data.geom_xpos[:, 2], corners[..., 2].max(axis=1))
            hidden |= highest < -0.5 * TABLE_THICKNESS
        instance.geom_group[:] = np.where(hidden, int(HIDDEN_GROUP), self._groups)

    def _corners(self, model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
        """Return the corners [G, 8, 3] of all geoms' bounding boxes in the world frame [m]."""
        local = model.geom_aabb[:, None, :3] + SIGNS * model.geom_aabb[:, None, 3:]
        turns = data.geom_xmat.reshape(-1, 3, 3)
        return np.asarray(local @ np.swapaxes(turns, 1, 2) + data.geom_xpos[:, None])

    def _outside(self, model: mujoco.MjModel, data: mujoco.MjData, corners: FloatArray) -> BoolArray:
        """Return which boxes [G] lie wholly beyond one of the four sides of the view."""
        turn = data.cam_xmat[self._camera].reshape(3, 3)
        across = (corners - data.cam_xpos[self._camera]) @ turn  # x right, y up, z backwards
        reach = -across[..., 2:] * self._slope(model)
        beyond = np.concatenate([across[..., :2] > reach, across[..., :2] < -reach], axis=-1)
        return np.asarray(beyond.all(axis=1).any(axis=-1) & ~self._endless)

    def _table_fills_the_view(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        slope = self._slope(model)
        rays = np.array([(x * slope, y * slope, -1.0) for x in (-1, 1) for y in (-1, 1)])
        turned = rays @ data.cam_xmat[self._camera].reshape(3, 3).T
        if not (turned[:, 2] < 0.0).all():
            return False
        place = data.cam_xpos[self._camera]
        met = place[:2] - turned[:, :2] * place[2] / turned[:, 2:]
        return bool((np.abs(met) <= TABLE_FILLS).all())

    def _slope(self, model: mujoco.MjModel) -> float:
        """Return the tangent of half the camera's angle of view."""
        return float(np.tan(0.5 * np.radians(model.cam_fovy[self._camera])))
