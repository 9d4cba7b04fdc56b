"""Opening: one arm holds a bottle's base, the other gives its cap a quarter turn (paper, section IV-A)."""

from functools import cached_property
from typing import ClassVar

import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.tasks.hinge_task import HingeTask

BOTTLE_SIZE = (0.06, 0.06, 0.19)
"""Width of the foot, twice, and height, cap included [m]."""
FOOT_HEIGHT = 0.01
"""[m]"""
BODY_RADIUS = 0.019
"""[m]"""
BODY_TOP = 0.15
"""Height of the body's upper end above the table [m]."""
CAP_RADIUS = 0.02
"""[m]"""
CAP_HEIGHT = 0.06
"""From the lower end of the cap to the top of its dome [m]."""
FRICTION = 1.2
"""Coefficient of sliding friction between rubber pads and the bottle, whose cap and body are ribbed."""
FOOT_FRICTION = 0.25
"""Coefficient of sliding friction between the foot and the table: glass on polished wood."""
FRICTION_STIFFNESS = 10
"""Of friction against normal force, in contacts: at 1 a round cap creeps out of round fingers in a second."""
TIMESTEP = 0.004
"""[s] with 8 ms too many of a perturbed expert's episodes end otherwise, see `bench.fidelity_causes`."""
HINGE_FRICTION = 0.06
"""Torque that the cap's thread resists with [Nm]: several times what the foot's friction holds."""
EXPERT_APPROACH = 0.7
"""[rad] approach angle of the expert's side grasp: its elbow is then out of the other arm's way."""


class Opening(HingeTask):
    """Turn the cap of a bottle that stands by friction: unless its base is held, the whole bottle turns."""

    name = "opening"
    family = "opening"
    summary = "give the cap of a bottle of varied place and size a quarter turn while its base keeps its pose"
    paper_schema = (("top_grasp", "side_grasp"), ("twist", "no_op"))
    location_range: ClassVar[tuple[float, float]] = (0.06, 0.06)
    scale_range: ClassVar[tuple[float, float]] = (0.9, 1.1)
    hinge_goal: ClassVar[float] = np.pi / 2
    position_tolerance: ClassVar[float] = 0.05
    orientation_tolerance: ClassVar[float] = 0.35
    top_grasp_height: ClassVar[float] = 0.5 - 0.5 * CAP_HEIGHT / BOTTLE_SIZE[2]

    @cached_property
    def pairs(self) -> PairSpace:
        """Sixteen pairs: top grasp, side grasp, twist and no-op for each arm."""
        return PairSpace([SKILLS[name] for name in ("top_grasp", "side_grasp", "twist", "no_op")])

    @property
    def object_size(self) -> tuple[float, float, float]:
        """Width, width and height of the bottle at scale 1 [m]."""
        return BOTTLE_SIZE

    @property
    def object_mjcf(self) -> str:
        """A base of foot and body, and a domed cap on a vertical hinge."""
        bottom, top = -0.5 * BOTTLE_SIZE[2], 0.5 * BOTTLE_SIZE[2]
        glass = f'friction="{FRICTION} 0.005 0.0001" density="1000" rgba="0.2 0.5 0.4 1"'
        return f"""
        <mujoco>
          <option timestep="{TIMESTEP}" cone="elliptic" impratio="{FRICTION_STIFFNESS}"/>
          <worldbody>
            <body name="object">
              <freejoint name="object"/>
              <geom name="foot" type="cylinder" size="{0.5 * BOTTLE_SIZE[0]} {0.5 * FOOT_HEIGHT}"
                pos="0 0 {bottom + 0.5 * FOOT_HEIGHT}" friction="{FOOT_FRICTION} 0.005 0.0001"
                density="1000"/>
              <geom name="body" type="capsule" size="{BODY_RADIUS}" {glass}
                fromto="0 0 {bottom + FOOT_HEIGHT + BODY_RADIUS} 0 0 {bottom + BODY_TOP - BODY_RADIUS}"/>
              <body name="cap" pos="0 0 0">
                <joint name="hinge" axis="0 0 1" frictionloss="{HINGE_FRICTION}" damping="0.002"
                  solimpfriction="0.99 0.999 0.001"/>
                <geom name="cap" type="capsule" size="{CAP_RADIUS}" {glass}
                  fromto="0 0 {top - CAP_HEIGHT + CAP_RADIUS} 0 0 {top - CAP_RADIUS}"/>
              </body>
            </body>
          </worldbody>
        </mujoco>
        """

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        """Grasp cap and base at their centres, the side grasp obliquely, then twist."""
        arguments = np.zeros((len(observations), self.pairs.argument_count))
        for arm in (0, 1):
            arguments[:, self.pairs.columns(arm, 1).stop - 1] = EXPERT_APPROACH
        return arguments
