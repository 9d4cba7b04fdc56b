"""What a scene looks like in one episode: colours, light and the camera's pose, if they vary."""

from dataclasses import dataclass

import mujoco
import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.euler import roll_pitch_yaw_quaternion

TABLE_BRIGHTNESS = (0.7, 1.1)
"""Factor on the table's colour."""
TABLE_TINT = 0.08
"""Largest share by which one of the table's red, green and blue changes: it stays wooden, more red than
blue, by which exchanged colours are noticed."""
OBJECT_TINT = (0.5, 1.5)
"""Factor on each of the object's red, green and blue."""
ARM_BRIGHTNESS = (0.7, 1.2)
"""Factor on all colours of the arms."""
LIGHT = (0.5, 1.3)
"""Factor on the light of each lamp, and on that from everywhere."""
LIGHT_TURN = 0.3
"""Largest part added to each coordinate of a lamp's direction, whose length is about 1."""
CAMERA_SHIFT = 0.005
"""Largest shift of the camera along each axis [m]."""
CAMERA_TURN = 0.005
"""Largest turn of the camera about each of its axes [rad]: 6 mm on the table."""


@dataclass(frozen=True)
class Looks:
    """One episode's looks, each drawn uniformly from -1 to 1 over its range."""

    table: FloatArray
    """[4] brightness, and tint of red, green and blue."""
    thing: FloatArray
    """[3] tint of the object's red, green and blue."""
    arms: float
    lights: FloatArray
    """[L, 4] brightness of each of L lamps, and its direction."""
    ambient: float
    camera: FloatArray
    """[6] shift and turn."""


class LooksModel:
    """Writes looks into copies of a scene's model, always from the template's values.

    Args:
        template: the compiled scene.
        camera: number of the camera that moves.

    """

    def __init__(self, template: mujoco.MjModel, camera: int) -> None:
        self._template = template
        self._camera = camera
        bodies = template.body_rootid[template.geom_bodyid]
        self._object = np.flatnonzero(bodies == template.body("object").id)
        self._table = template.material("table").id
        names = [template.material(index).name for index in range(template.nmat)]
        self._arms = np.array([index for index, name in enumerate(names) if name.startswith("sawyer_")])

    def draw(self, generator: np.random.Generator) -> Looks:
        """Draw an episode's looks."""
        count = self._template.nlight
        return Looks(
            table=generator.uniform(-1.0, 1.0, 4),
            thing=generator.uniform(-1.0, 1.0, 3),
            arms=generator.uniform(-1.0, 1.0),
            lights=generator.uniform(-1.0, 1.0, (count, 4)),
            ambient=generator.uniform(-1.0, 1.0),
            camera=generator.uniform(-1.0, 1.0, 6),
        )

    def write(self, model: mujoco.MjModel, looks: Looks) -> None:
        """Give `model`, a copy of the template, these looks."""
        source = self._template
        wood = _between(TABLE_BRIGHTNESS, looks.table[0]) * (1.0 + TABLE_TINT * looks.table[1:])
        model.mat_rgba[self._table, :3] = _painted(source.mat_rgba[self._table, :3], wood)
        paint = _between(OBJECT_TINT, looks.thing)
        model.geom_rgba[self._object, :3] = _painted(source.geom_rgba[self._object, :3], paint)
        dark = _between(ARM_BRIGHTNESS, looks.arms)
        model.mat_rgba[self._arms, :3] = _painted(source.mat_rgba[self._arms, :3], dark)
        model.light_diffuse[:] = source.light_diffuse * _between(LIGHT, looks.lights[:, :1])
        turned = source.light_dir + LIGHT_TURN * looks.lights[:, 1:]
        model.light_dir[:] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        model.vis.headlight.ambient[:] = source.vis.headlight.ambient * _between(LIGHT, looks.ambient)
        model.cam_pos[self._camera] = source.cam_pos[self._camera] + CAMERA_SHIFT * looks.camera[:3]
        turn = roll_pitch_yaw_quaternion(CAMERA_TURN * looks.camera[None, 3:])[0]
        mujoco.mju_mulQuat(model.cam_quat[self._camera], source.cam_quat[self._camera], turn)


def _between(ends: tuple[float, float], place: FloatArray | float) -> FloatArray:
    """Return what lies at -1 to 1 between two ends."""
    low, high = ends
    return np.asarray(low + 0.5 * (place + 1.0) * (high - low))


def _painted(colours: FloatArray, factors: FloatArray) -> FloatArray:
    return np.minimum(colours * factors, 1.0)
