"""Picking: two arms lift a slippery ball by 25 cm (paper, section IV-A)."""

import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
import os
BALL_RADIUS = float(os.environ.get("RAD","0.06"))
DENSITY = float(os.environ.get("MASS","0.5"))/(4/3*np.pi*BALL_RADIUS**3)
LOCATION_RANGE = (0.08, float(os.environ.get("YR","0.04")))
FRICTION_RANGE = tuple(map(float, os.environ.get("FR","0.5,0.8").split(",")))
ROLLING = float(os.environ.get("ROLL","0.002"))
LIFT_GOAL = 0.25
SIDE = float(os.environ.get("SIDE","0.08"))
SQ = float(os.environ.get("SQ","-0.03"))

CORNERS = tuple(itertools.product((-1.0, 1.0), repeat=3))


class Picking(SceneTask):
    """x."""

    name = "picking"
    family = "picking"
    summary = "lift a slippery ball, too large for one hand, of varied place and friction by 25 cm with both arms"
    paper_schema = (("top_grasp", "go_to_pose"), ("no_op", "go_to_pose"), ("lift", "lift"))

    @cached_property
    def pairs(self) -> PairSpace:
        return PairSpace([SKILLS[name] for name in ("top_grasp", "go_to_pose", "lift", "no_op")])

    @property
    def object_size(self) -> tuple[float, float, float]:
        return (2 * BALL_RADIUS,) * 3

    @property
    def object_mjcf(self) -> str:
        return f"""
        <mujoco>
          <worldbody>
            <body name="object">
              <freejoint name="object"/>
              <geom name="ball" type="sphere" size="{BALL_RADIUS}" density="1000" priority="1" condim="6" solimp="{os.environ.get("SOLIMP","0.9 0.95 0.001 0.5 2")}" solref="{os.environ.get("SOLREF","0.02 1")}"
                friction="{FRICTION_RANGE[0]} 0.002 {ROLLING}" rgba="0.85 0.3 0.2 1"/>
            </body>
          </worldbody>
        </mujoco>
        """

    def draw_instance(self, generator: np.random.Generator) -> ObjectInstance:
        return self._instance(generator.uniform(-1.0, 1.0, 3))

    @property
    def corner_names(self) -> Sequence[str]:
        return [str(c) for c in CORNERS]

    def draw_corner(self, corner: int, generator: np.random.Generator) -> ObjectInstance:
        return self._instance(np.array(CORNERS[corner]) * generator.uniform(0.9, 1.0, 3))

    def _instance(self, place: AnyArray) -> ObjectInstance:
        low, high = FRICTION_RANGE
        return ObjectInstance(
            position=(float(place[0]) * LOCATION_RANGE[0], float(place[1]) * LOCATION_RANGE[1], BALL_RADIUS),
            quaternion=(1.0, 0.0, 0.0, 0.0),
            density=DENSITY,
            friction=low + 0.5 * (float(place[2]) + 1.0) * (high - low),
        )

    def goal_reached(self, start: AnyArray, poses: AnyArray) -> BoolArray:
        return np.asarray(poses[..., 2] - start[:, None, 2] >= LIFT_GOAL)

    def goal_distance(self, start: AnyArray, poses: AnyArray) -> FloatArray:
        return np.asarray(np.maximum(LIFT_GOAL - (poses[..., 2] - start[:, None, 2]), 0.0) / LIFT_GOAL)

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        arguments = np.zeros((len(observations), self.pairs.argument_count))
        for arm, side in enumerate((-1.0, 1.0)):
            arguments[:, self.pairs.columns(arm, 0)] = (0.0, side * SIDE, 0.0)
            y = side * (SIDE if step == 0 else SQ)
            arguments[:, self.pairs.columns(arm, 1)] = (0.0, y, 0.0, np.pi, 0.0, 0.0)
            arguments[:, self.pairs.columns(arm, 2)] = 0.35
        return arguments
