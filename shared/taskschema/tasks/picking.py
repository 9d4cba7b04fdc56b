"""Picking: two arms lift a slippery ball by 25 cm (paper, section IV-A)."""

import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.tasks.scene_task import ObjectInstance, SceneTask

BALL_RADIUS = 0.075
"""[m]"""
DENSITY = 226.0
"""[kg/m^3] a ball of 0.4 kg."""
LOCATION_RANGE = (0.08, 0.04)
"""The ball's centre is drawn uniformly within +- these distances of the table's centre in x and y [m]."""
FRICTION_RANGE = (0.7, 1.0)
"""Coefficient of sliding friction between the ball and whatever touches it."""
ROLLING_RESISTANCE = 0.012
"""[m] how far ahead of its centre a rolling ball is supported: a soft ball that soon comes to rest."""
TIMESTEP = 0.002
"""[s] a ball that friction barely holds slips earlier with larger steps, see `bench.fidelity_causes`."""
LIFT_GOAL = 0.25
"""[m] paper: 25 cm."""

GRASP_DISTANCE = 0.09
"""[m] from the ball's centre to where the expert's top grasp comes down beside it."""
PRESS_OFFSET = (0.01, -0.015)
"""[m] past the ball's centre, and up, where the expert's go-to pose aims."""
PRESS_ROLL = 0.4 * np.pi
"""[rad] the expert turns a hand that points down about x, until it points 18 degrees below the horizontal."""
EXPERT_LIFT = 0.35
"""[m]"""

CORNERS = tuple(itertools.product((-1.0, 1.0), repeat=3))
"""Signs of x, y and friction at the corners of the randomisation."""


class Picking(SceneTask):
    """Lift the ball between both hands: too large and too slippery for the fingers of one."""

    name = "picking"
    family = "picking"
    summary = "lift a slippery ball, too large for one hand, of varied place and friction by 25 cm"
    paper_schema = (("top_grasp", "go_to_pose"), ("no_op", "go_to_pose"), ("lift", "lift"))
    lift_speed = 0.3
    location_range = LOCATION_RANGE
    pose_height = PRESS_OFFSET[1] / (2.0 * BALL_RADIUS)

    @cached_property
    def pairs(self) -> PairSpace:
        """Sixteen pairs: top grasp, go-to pose, lift and no-op for each arm."""
        return PairSpace([SKILLS[name] for name in ("top_grasp", "go_to_pose", "lift", "no_op")])

    @property
    def object_size(self) -> tuple[float, float, float]:
        """The ball's diameter three times [m]."""
        return (2.0 * BALL_RADIUS,) * 3

    @property
    def object_mjcf(self) -> str:
        """One sphere with a free joint; its own friction counts, whatever touches it."""
        return f"""
        <mujoco>
          <option timestep="{TIMESTEP}" cone="elliptic"/>
          <worldbody>
            <body name="object">
              <freejoint name="object"/>
              <geom name="ball" type="sphere" size="{BALL_RADIUS:g}" density="1000" priority="1" condim="6"
                friction="{FRICTION_RANGE[0]:g} 0.002 {ROLLING_RESISTANCE:g}" solimp="0.99 0.999 0.001 0.5 2"
                rgba="0.85 0.3 0.2 1"/>
            </body>
          </worldbody>
        </mujoco>
        """

    def draw_instance(self, generator: np.random.Generator) -> ObjectInstance:
        """Draw location and friction, all uniform."""
        return self._instance(generator.uniform(-1.0, 1.0, 3))

    @property
    def corner_names(self) -> Sequence[str]:
        """The eight corners of location and friction."""
        return [
            f"x {x * LOCATION_RANGE[0]:+.2f} m, y {y * LOCATION_RANGE[1]:+.2f} m, "
            f"friction {FRICTION_RANGE[friction > 0]:.1f}"
            for x, y, friction in CORNERS
        ]

    def draw_corner(self, corner: int, generator: np.random.Generator) -> ObjectInstance:
        """Draw from the outer tenth of the ranges of location and friction."""
        return self._instance(np.array(CORNERS[corner]) * generator.uniform(0.9, 1.0, 3))

    def _instance(self, place: AnyArray) -> ObjectInstance:
        """Return the ball at `place` [3]: x, y and friction, each from -1 to 1 over its range."""
        low, high = FRICTION_RANGE
        return ObjectInstance(
            position=(
                float(place[0]) * LOCATION_RANGE[0],
                float(place[1]) * LOCATION_RANGE[1],
                BALL_RADIUS,
            ),
            quaternion=(1.0, 0.0, 0.0, 0.0),
            density=DENSITY,
            friction=low + 0.5 * (float(place[2]) + 1.0) * (high - low),
        )

    def goal_reached(self, start: AnyArray, poses: AnyArray) -> BoolArray:
        """Test that the centre is 25 cm above its start."""
        return np.asarray(poses[..., 2] - start[:, None, 2] >= LIFT_GOAL)

    def goal_distance(self, start: AnyArray, poses: AnyArray) -> FloatArray:
        """Return the share of the height that is missing; 0 at the goal."""
        return np.asarray(np.maximum(LIFT_GOAL - (poses[..., 2] - start[:, None, 2]), 0.0) / LIFT_GOAL)

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        """Come down beside the ball, press it from the other side, lift by 35 cm.

        All arguments are relative to the ball, whose orientation does not matter. Each arm has those of its
        own side.
        """
        arguments = np.zeros((len(observations), self.pairs.argument_count))
        past, up = PRESS_OFFSET
        for arm, side in enumerate((-1.0, 1.0)):
            roll = np.pi - side * PRESS_ROLL
            arguments[:, self.pairs.columns(arm, 0)] = (0.0, side * GRASP_DISTANCE, 0.0)
            arguments[:, self.pairs.columns(arm, 1)] = (0.0, -side * past, up, roll, np.pi, np.pi)
            arguments[:, self.pairs.columns(arm, 2)] = EXPERT_LIFT
        return arguments
