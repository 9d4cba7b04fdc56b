"""Draws the scene of a task off screen."""

import copy
from types import TracebackType
from typing import Self

import mujoco
import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.errors import RenderingError
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema_worker.object_model import ObjectModel
from taskschema_worker.rendering.backend import new_context
from taskschema_worker.rendering.frame import Frame
from taskschema_worker.rendering.looks import Looks, LooksModel
from taskschema_worker.rendering.seen_geoms import SeenGeoms
from taskschema_worker.rendering.visual_scene import visual_model
from taskschema_worker.simulation import SceneIndices

MOST_GEOMS = 1000
VISUAL_GROUP = 1
"""Geom group of the arms' meshes, and of table and floor."""
FINE_SAMPLES, FINE_SHADOWS = 4, 2048
"""Multisampling and edge length of the shadow map [pixel] of fine pictures."""


class SceneRenderer:
    """Draws one task's scene with one camera; close it, or use it in `with`, on one thread.

    Args:
        task: whose scene it is.
        width: of a frame [pixel].
        height: of a frame [pixel].
        camera: `overhead` (straight down, x to the right, y up), `front` (both arms, from the table's side)
            or `close` (the hands).
        fine: with shadows, reflections and smooth edges, for people; without, several times as fast.

    Raises:
        RenderingError: if nothing on this machine can draw.

    """

    def __init__(
        self, task: SceneTask, width: int, height: int, camera: str = "overhead", *, fine: bool = False
    ) -> None:
        self._model = visual_model(task)
        self._model.vis.quality.offsamples = FINE_SAMPLES if fine else 0
        self._model.vis.quality.shadowsize = FINE_SHADOWS if fine else 0
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = width, height
        self._object = ObjectModel(self._model)
        self._instance = copy.copy(self._model)
        bodies = self._model.body_rootid[self._model.geom_bodyid]
        self._object_geoms = set(np.flatnonzero(bodies == self._model.body("object").id).tolist())
        self._data = mujoco.MjData(self._model)
        self.home_positions: FloatArray = np.array(self._model.qpos0, dtype=np.float64)
        """`qpos` [nq] with the arms at the start of an episode and the object in the middle."""
        self.home_positions[SceneIndices(self._model).arm_positions] = task.home_joints
        self._view = mujoco.MjvCamera()
        self._view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._view.fixedcamid = self._model.camera(camera).id
        self._seen = None if fine or width != height else SeenGeoms(self._model, self._view.fixedcamid)
        self._looks = LooksModel(self._model, self._view.fixedcamid)
        self._options = mujoco.MjvOption()
        self._scene = mujoco.MjvScene(self._model, MOST_GEOMS)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._scene.flags[flag] = fine
        # Seen from above it takes a tenth of the time, although no pixel shows it.
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = camera != "overhead"
        self._viewport = mujoco.MjrRect(0, 0, width, height)
        self._frame = np.empty((height, width, 3), dtype=np.uint8)
        self._window = new_context(width, height)
        self._window.make_current()
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        if self._context.currentBuffer != mujoco.mjtFramebuffer.mjFB_OFFSCREEN:
            raise RenderingError("The renderer has no off-screen buffer: see `taskschema doctor`.")

    def set_object(self, instance: ObjectInstance) -> None:
        """Draw this episode's object from now on: its size counts, its mass is not seen."""
        self._object.write(self._instance, instance)

    def draw_looks(self, generator: np.random.Generator) -> Looks:
        """Draw colours, light and camera pose of an episode."""
        return self._looks.draw(generator)

    def set_looks(self, looks: Looks) -> None:
        """Draw with these colours, light and camera pose from now on."""
        self._looks.write(self._instance, looks)

    def render(self, positions: AnyArray) -> Frame:
        """Draw a state of the simulation, given as `qpos` [nq], into a new frame."""
        self._data.qpos[:] = positions
        mujoco.mj_kinematics(self._instance, self._data)
        mujoco.mj_camlight(self._instance, self._data)
        if self._seen is not None:
            self._seen.hide_others(self._instance, self._data)
        mujoco.mjv_updateScene(
            self._instance,
            self._data,
            self._options,
            None,
            self._view,
            mujoco.mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        self._window.make_current()
        mujoco.mjr_render(self._viewport, self._scene, self._context)
        mujoco.mjr_readPixels(self._frame, None, self._viewport, self._context)
        return self._frame[::-1].copy()

    def object_pixels(self, positions: AnyArray, *, arms: bool = True) -> int:
        """Return how many pixels of a state `qpos` [nq] show the object; with or without the arms."""
        flags = [int(mujoco.mjtRndFlag.mjRND_SEGMENT), int(mujoco.mjtRndFlag.mjRND_IDCOLOR)]
        self._scene.flags[flags] = True
        self._options.geomgroup[VISUAL_GROUP] = arms
        try:
            red, green, blue = np.moveaxis(self.render(positions).astype(np.int64), -1, 0)
        finally:
            self._scene.flags[flags] = False
            self._options.geomgroup[VISUAL_GROUP] = True
        shown = self._scene.geoms[: self._scene.ngeom]
        numbers = [
            geom.segid + 1
            for geom in shown
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.objid in self._object_geoms
        ]
        return int(np.isin(red + 256 * green + 65536 * blue, numbers).sum())

    def close(self) -> None:
        """Give back what the renderer holds."""
        self._context.free()
        self._window.free()

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()
