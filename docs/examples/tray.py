"""A task of one's own with physics: two arms lift a tray by its two handles.

`taskschema train --task-file docs/examples/tray.py:Tray`; docs/add-a-task.md explains it.
"""

from functools import cached_property

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.tasks.scene_task import ObjectInstance, SceneTask

PLATE = (0.30, 0.22, 0.02)
"""Length along x, width along y and thickness [m]."""
HANDLE = (0.16, 0.016, 0.045)
"""Length along x, width along y and height above the plate [m]."""
HANDLE_DISTANCE = 0.085
"""Of each handle from the tray's middle, along y [m]: one on each robot's side."""
HEIGHT = PLATE[2] + HANDLE[2]
FRICTION = 1.0
LOCATION_RANGE = (0.05, 0.05)
"""The tray's centre is drawn uniformly within +- these from the table's centre along x and y [m]."""
DENSITY_RANGE = (1000.0, 1400.0)
"""[kg/m^3]: 1.5 to 2.2 kg."""
LIFT_GOAL = 0.15
"""Height gained [m]."""
TILT_LIMIT = 0.25
"""Largest tilt and turn on the way [rad]: a tray that hangs from one handle tilts far more."""
CORNERS = [(x, y, density) for x in (-1, 1) for y in (-1, 1) for density in (-1, 1)]


class Tray(SceneTask):
    """Two arms carry what tips over in the hands of one."""

    name = "tray"
    family = "lateral_lifting"  # one of the families that the skills are allowed in
    summary = "lift a tray of varied place and density by 15 cm without tilting it"
    paper_schema = (("top_grasp", "top_grasp"), ("lift", "lift"))
    location_range = LOCATION_RANGE
    top_grasp_height = (PLATE[2] + 0.5 * HANDLE[2]) / HEIGHT - 0.5  # the middle of a handle

    @cached_property
    def pairs(self) -> PairSpace:
        """Nine pairs: top grasp, lift and no-op for each arm."""
        return PairSpace([SKILLS[name] for name in ("top_grasp", "lift", "no_op")])

    @property
    def object_size(self) -> tuple[float, float, float]:
        """Length, width and height of the whole tray [m]."""
        return (PLATE[0], PLATE[1], HEIGHT)

    @property
    def object_mjcf(self) -> str:
        """Everything that belongs to the object, around the middle of its bounding box."""

        def box(name: str, size: tuple[float, float, float], y: float, bottom: float, colour: str) -> str:
            half = " ".join(f"{0.5 * edge}" for edge in size)
            z = bottom + 0.5 * size[2] - 0.5 * HEIGHT
            return (
                f'<geom name="{name}" type="box" size="{half}" pos="0 {y} {z}" density="1000" '
                f'friction="{FRICTION} 0.005 0.0001" rgba="{colour} 1"/>'
            )

        return f"""
        <mujoco>
          <worldbody>
            <body name="object">
              <freejoint name="object"/>
              {box("plate", PLATE, 0.0, 0.0, "0.25 0.45 0.65")}
              {box("near", HANDLE, -HANDLE_DISTANCE, PLATE[2], "0.9 0.75 0.3")}
              {box("far", HANDLE, HANDLE_DISTANCE, PLATE[2], "0.9 0.75 0.3")}
            </body>
          </worldbody>
        </mujoco>
        """

    def draw_instance(self, generator: np.random.Generator) -> ObjectInstance:
        """Draw place and density, all uniform, from this generator alone."""
        return self._instance(generator.uniform(-1.0, 1.0, 3))

    @property
    def corner_names(self) -> list[str]:
        """The eight corners of place and density."""
        return [f"x {x:+d}, y {y:+d}, density {density:+d}" for x, y, density in CORNERS]

    def draw_corner(self, corner: int, generator: np.random.Generator) -> ObjectInstance:
        """Draw from the outer tenth of the ranges."""
        return self._instance(np.array(CORNERS[corner]) * generator.uniform(0.9, 1.0, 3))

    def _instance(self, place: FloatArray) -> ObjectInstance:
        """Return the tray for x, y and density, each from -1 to 1 over its range."""
        x, y = np.array(LOCATION_RANGE) * place[:2]
        low, high = DENSITY_RANGE
        return ObjectInstance(
            position=(float(x), float(y), 0.5 * HEIGHT),
            quaternion=(1.0, 0.0, 0.0, 0.0),
            density=float(low + 0.5 * (place[2] + 1.0) * (high - low)),
        )

    def goal_reached(self, start: AnyArray, poses: AnyArray) -> BoolArray:
        """Test the goal at every moment of M motions: 15 cm higher, and hardly tilted."""
        return np.asarray(self.goal_distance(start, poses) == 0.0)

    def goal_distance(self, start: AnyArray, poses: AnyArray) -> FloatArray:
        """Return the share of the height missing plus the excess tilt in limits: 0 at the goal."""
        missing = np.maximum(LIFT_GOAL - (poses[..., 2] - start[:, None, 2]), 0.0) / LIFT_GOAL
        cosine = np.abs(np.einsum("msi,mi->ms", poses[..., 3:7], start[:, 3:7]))
        turn = 2.0 * np.arccos(np.minimum(cosine, 1.0))
        return np.asarray(missing + np.maximum(turn / TILT_LIMIT - 1.0, 0.0))

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        """Each arm takes the handle on its own side, its fingers closing along y, then lifts by 25 cm."""
        arguments = np.zeros((len(observations), self.pairs.argument_count))
        for arm, side in enumerate((-1.0, 1.0)):
            x, y, turn = range(*self.pairs.columns(arm, 0).indices(arguments.shape[1]))
            arguments[:, x], arguments[:, y], arguments[:, turn] = 0.0, side * HANDLE_DISTANCE, 0.5 * np.pi
            arguments[:, self.pairs.columns(arm, 1)] = 0.25
        return arguments
