"""Lateral lifting: two arms lift a heavy, long bar by 25 cm (paper, section IV-A)."""

import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.kinematics.rotation import half_angle_cosine
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.tasks.scene_task import ObjectInstance, SceneTask

BAR_SIZE = (0.9, 0.016, 0.045)
"""Length, width and height [m]."""
BAR_YAW = np.pi / 4
"""Angle of the bar's length to the world's x axis [rad]."""
LOCATION_RANGE = (0.08, 0.08)
"""The bar's centre is drawn uniformly within +- these distances from the table's centre along x and y [m]."""
DENSITY_RANGE = (6800.0, 7900.0)
"""[kg/m^3]"""
FRICTION = 1.05
"""Coefficient of sliding friction between the bar and whatever touches it."""
LIFT_GOAL = 0.25
"""[m] paper: 25 cm."""
ORIENTATION_TOLERANCE = 0.2
"""[rad] largest angle, about any axis, between the bar's orientation and the one it started with."""

CORNERS = tuple(itertools.product((-1.0, 1.0), repeat=3))
"""Signs of x, y and density at the corners of the randomisation."""


class LateralLifting(SceneTask):
    """Lift the bar with both arms: too heavy for one hand's grip, so that one arm alone cannot do it."""

    name = "lateral-lifting"
    family = "lateral_lifting"
    summary = (
        "lift a heavy, long bar of varied place and density by 25 cm with both arms, keeping its orientation"
    )
    paper_schema = (("top_grasp", "top_grasp"), ("lift", "lift"))
    location_range = LOCATION_RANGE

    @cached_property
    def pairs(self) -> PairSpace:
        """Nine pairs: top grasp, lift and no-op for each arm."""
        return PairSpace([SKILLS[name] for name in ("top_grasp", "lift", "no_op")])

    @property
    def object_size(self) -> tuple[float, float, float]:
        """Length, width and height of the bar [m]."""
        return BAR_SIZE

    @property
    def object_mjcf(self) -> str:
        """One box with a free joint."""
        half = " ".join(f"{0.5 * edge:g}" for edge in BAR_SIZE)
        return f"""
        <mujoco>
          <worldbody>
            <body name="object">
              <freejoint name="object"/>
              <geom name="bar" type="box" size="{half}" density="1000" friction="{FRICTION} 0.005 0.0001"
                rgba="0.55 0.57 0.6 1"/>
            </body>
          </worldbody>
        </mujoco>
        """

    def draw_instance(self, generator: np.random.Generator) -> ObjectInstance:
        """Draw location and density, all uniform."""
        return self._instance(generator.uniform(-1.0, 1.0, 3))

    @property
    def corner_names(self) -> Sequence[str]:
        """The eight corners of location and density."""
        return [
            f"x {x * LOCATION_RANGE[0]:+.2f} m, y {y * LOCATION_RANGE[1]:+.2f} m, "
            f"{DENSITY_RANGE[density > 0]:.0f} kg/m^3"
            for x, y, density in CORNERS
        ]

    def draw_corner(self, corner: int, generator: np.random.Generator) -> ObjectInstance:
        """Draw from the outer tenth of the ranges of location and density."""
        return self._instance(np.array(CORNERS[corner]) * generator.uniform(0.9, 1.0, 3))

    def _instance(self, place: AnyArray) -> ObjectInstance:
        """Return the bar at `place` [3]: x, y and density, each from -1 to 1 over its range."""
        low, high = DENSITY_RANGE
        return ObjectInstance(
            position=(
                float(place[0]) * LOCATION_RANGE[0],
                float(place[1]) * LOCATION_RANGE[1],
                0.5 * BAR_SIZE[2],
            ),
            quaternion=(float(np.cos(BAR_YAW / 2)), 0.0, 0.0, float(np.sin(BAR_YAW / 2))),
            density=low + 0.5 * (float(place[2]) + 1.0) * (high - low),
        )

    def goal_reached(self, start: AnyArray, poses: AnyArray) -> BoolArray:
        """Test that the centre is 25 cm above its start and the orientation within tolerance of it."""
        risen = poses[..., 2] - start[:, None, 2] >= LIFT_GOAL
        straight = half_angle_cosine(poses[..., 3:], start[:, None, 3:]) >= np.cos(
            0.5 * ORIENTATION_TOLERANCE
        )
        return np.asarray(risen & straight)

    def goal_distance(self, start: AnyArray, poses: AnyArray) -> FloatArray:
        """Return the share of the height missing plus the excess turn in tolerances; 0 at the goal."""
        missing = np.maximum(LIFT_GOAL - (poses[..., 2] - start[:, None, 2]), 0.0) / LIFT_GOAL
        angle = 2.0 * np.arccos(np.minimum(half_angle_cosine(poses[..., 3:], start[:, None, 3:]), 1.0))
        return np.asarray(missing + np.maximum(angle / ORIENTATION_TOLERANCE - 1.0, 0.0))

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        """Grasp on both sides of the centre, each arm on its own, then lift by 35 cm.

        The grasps follow from the bar's orientation in the observation.
        """
        quaternion = self.observation.get(observations, "object.quaternion")
        yaw = 2.0 * np.arctan2(quaternion[:, 3], quaternion[:, 0])
        arguments = np.zeros((len(observations), self.pairs.argument_count))
        for arm, side in enumerate((-1.0, 1.0)):
            grasp = self.pairs.columns(arm, 0)
            along = side * 0.09 * np.sign(np.sin(yaw)) * np.sqrt(2.0)
            values = np.stack(
                [along * np.cos(yaw), along * np.sin(yaw), np.mod(yaw + 0.5 * np.pi, 2.0 * np.pi)], axis=1
            )
            arguments[:, grasp] = values
            arguments[:, self.pairs.columns(arm, 1)] = 0.35
        return arguments
