"""What the overhead camera sees."""

import asyncio
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from taskschema.arrays import FloatArray
from taskschema_robot.camera.camera import Image
from taskschema_robot.errors import CameraError
from taskschema_robot.twin.scene import CAMERA, PICTURE

FRAME_RATE = 30.0
"""[Hz]"""


@dataclass(frozen=True, eq=False)
class Exposure:
    """One picture that the camera takes, before anybody has asked for its pixels."""

    time: float
    """When it is taken, on the twin's clock [s]."""
    number: int
    """Counts up with every picture."""
    positions: FloatArray
    """The world's qpos then."""
    mocap: FloatArray
    """Where the obstacle was."""

    @property
    def digest(self) -> int:
        """Of what is to be seen: the world never rests to the last bit, as no camera is without noise."""
        return zlib.crc32(self.mocap.tobytes(), zlib.crc32(self.positions.tobytes()))


class PictureTaker:
    """A camera that takes `FRAME_RATE` pictures a second, of which only those asked for are rendered.

    Rendering runs off screen, in a thread of its own: a graphics context belongs to one thread.

    Args:
        model: what the camera sees, with the `qpos` of the world; see `picture_model`.

    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._data = mujoco.MjData(model)
        self._thread = ThreadPoolExecutor(1, "picture")
        self._renderer: mujoco.Renderer | None = None
        self._frozen: Exposure | None = None
        self._repeated: Exposure | None = None

    def expose(self, data: mujoco.MjData, now: float) -> Exposure:
        """Return the newest picture, not yet rendered."""
        if self._frozen is not None:
            return self._frozen
        number = int(now * FRAME_RATE)
        if self._repeated is not None:
            return replace(self._repeated, time=now, number=number)
        return Exposure(now, number, np.array(data.qpos), np.array(data.mocap_pos))

    def freeze(self, exposure: Exposure | None) -> None:
        """Deliver nothing newer than one picture from now on; None: go on."""
        self._frozen = exposure

    def repeat(self, exposure: Exposure | None) -> None:
        """Deliver one picture again and again as if it were new; None: go on."""
        self._repeated = exposure

    async def render(self, exposure: Exposure) -> Image:
        """Return a picture's pixels [H, W, 3].

        Raises:
            CameraError: if this machine cannot render off screen.
        """
        loop = asyncio.get_running_loop()
        try:
            return await loop.run_in_executor(self._thread, self._render, exposure)
        except Exception as error:  # whatever an OpenGL library raises where it does not work
            raise CameraError(
                f"The twin cannot render its camera ({error}): install an EGL or OSMesa library and set"
                " MUJOCO_GL to egl or osmesa."
            ) from error

    def _render(self, exposure: Exposure) -> Image:
        if self._renderer is None:
            self._renderer = mujoco.Renderer(self._model, PICTURE, PICTURE)
        self._data.qpos[:] = exposure.positions
        self._data.mocap_pos[:] = exposure.mocap
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._renderer.update_scene(self._data, CAMERA)
        return np.array(self._renderer.render())

    def close(self) -> None:
        """Give the graphics context back."""
        if self._renderer is not None:
            self._thread.submit(self._renderer.close).result()
        self._thread.shutdown()
