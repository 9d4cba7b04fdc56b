"""The object's part of a compiled scene, rewritten for every episode's own density, friction and size."""

import mujoco
import numpy as np

from taskschema.tasks.scene_task import ObjectInstance

TEMPLATE_DENSITY = 1000.0
"""Density that object models are written with [kg/m^3]."""


class ObjectModel:
    """Writes an instance's object into copies of a scene's model, always from the template's values.

    Compiling a scene takes tens of milliseconds, this takes one tenth of one: every length of a scaled body
    grows with the scale, its mass with the cube, its inertia with the fifth power.

    Args:
        template: the compiled scene, whose object has `TEMPLATE_DENSITY` and scale 1.

    """

    def __init__(self, template: mujoco.MjModel) -> None:
        self._template = template
        self._scratch = mujoco.MjData(template)
        root = template.body("object").id
        self._bodies = np.flatnonzero(template.body_rootid == root)
        self._links = self._bodies[self._bodies != root]
        self._geoms = np.flatnonzero(np.isin(template.geom_bodyid, self._bodies))
        self._boxes = np.concatenate(
            [
                np.arange(template.body_bvhadr[body], template.body_bvhadr[body] + template.body_bvhnum[body])
                for body in self._bodies
            ]
        )

    def write(self, model: mujoco.MjModel, instance: ObjectInstance) -> None:
        """Give `model`, a copy of the template, what its object has of its own."""
        source, scale = self._template, instance.scale
        factor = instance.density / TEMPLATE_DENSITY
        bodies, links, geoms = self._bodies, self._links, self._geoms
        model.body_mass[bodies] = source.body_mass[bodies] * factor * scale**3
        model.body_inertia[bodies] = source.body_inertia[bodies] * factor * scale**5
        model.body_ipos[bodies] = source.body_ipos[bodies] * scale
        model.body_pos[links] = source.body_pos[links] * scale
        model.geom_pos[geoms] = source.geom_pos[geoms] * scale
        model.geom_size[geoms] = source.geom_size[geoms] * scale
        model.geom_rbound[geoms] = source.geom_rbound[geoms] * scale
        model.geom_aabb[geoms] = source.geom_aabb[geoms] * scale
        model.bvh_aabb[self._boxes] = source.bvh_aabb[self._boxes] * scale
        sliding = source.geom_friction[geoms, 0]
        model.geom_friction[geoms, 0] = sliding if instance.friction is None else instance.friction
        mujoco.mj_setConst(model, self._scratch)
