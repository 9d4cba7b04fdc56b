"""Rotating: one arm holds a corkscrew's base, the other turns its handle by half (paper, section IV-A)."""

from functools import cached_property
from typing import ClassVar

import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.tasks.hinge_task import HingeTask

FOOT_RADIUS = 0.04
"""[m]"""
FOOT_HEIGHT = 0.01
"""[m]"""
BODY_RADIUS = 0.013
"""[m]"""
BODY_TOP = 0.11
"""Height of the body's upper end above the table [m]."""
BAR_LENGTH = 0.22
"""Of the handle, end to end [m]."""
BAR_RADIUS = 0.01
"""[m]"""
BAR_DIRECTION = np.deg2rad(70.0)
"""Angle of the handle to the world's x axis at the start [rad]: nearly along the line between the robots.

Half a turn then begins on one robot's side and keeps clear of a hand that comes from the other."""
CORKSCREW_SIZE = (0.22, 0.22, 0.14)
"""Length of the handle, twice, and height [m]."""
FRICTION = 1.2
"""Coefficient of sliding friction between rubber pads and the ribbed base."""
HANDLE_FRICTION = 0.3
"""Coefficient of sliding friction between a hand and the polished handle."""
FOOT_FRICTION = 0.25
"""Coefficient of sliding friction between the foot and the table."""
FRICTION_STIFFNESS = 10
"""Of friction against normal force, in contacts; see `opening`."""
HINGE_FRICTION = 0.05
"""Torque that the hinge resists with [Nm]: several times what the foot's friction holds."""

EXPERT_APPROACH = 0.8
"""[rad] approach angle of the expert's side grasp."""
EXPERT_POSE_HEIGHT = 0.045
"""Of the expert's go-to poses above the object's centre, at scale 1 [m]: level with the handle."""
EXPERT_POSE_TURN = (np.pi, np.pi, 0.75 * np.pi)
"""[rad] roll, pitch and yaw of the expert's go-to poses: straight down, the fingers across the handle."""


class Rotating(HingeTask):
    """Push the handle around: unless the base is held, the whole corkscrew moves."""

    name = "rotating"
    family = "rotating"
    summary = (
        "give the handle of a corkscrew of varied place and size half a turn while its base keeps its pose"
    )
    paper_schema = (("go_to_pose", "side_grasp"), ("go_to_pose", "no_op"), ("rotate", "no_op"))
    location_range: ClassVar[tuple[float, float]] = (0.06, 0.06)
    scale_range: ClassVar[tuple[float, float]] = (0.9, 1.1)
    hinge_goal: ClassVar[float] = np.pi
    position_tolerance: ClassVar[float] = 0.05
    orientation_tolerance: ClassVar[float] = 0.35

    side_grasp_height: ClassVar[float] = 0.06 / CORKSCREW_SIZE[2] - 0.5
    pose_height: ClassVar[float] = EXPERT_POSE_HEIGHT / CORKSCREW_SIZE[2]

    @cached_property
    def pairs(self) -> PairSpace:
        """Sixteen pairs: side grasp, go-to pose, rotate and no-op for each arm."""
        return PairSpace([SKILLS[name] for name in ("side_grasp", "go_to_pose", "rotate", "no_op")])

    @property
    def object_size(self) -> tuple[float, float, float]:
        """Length of the handle, twice, and height of the corkscrew at scale 1 [m]."""
        return CORKSCREW_SIZE

    @property
    def object_mjcf(self) -> str:
        """A base of foot and body, and a T-handle on a vertical hinge."""
        bottom, bar = -0.5 * CORKSCREW_SIZE[2], 0.5 * CORKSCREW_SIZE[2] - BAR_RADIUS
        reach = 0.5 * BAR_LENGTH - BAR_RADIUS
        x, y = reach * np.cos(BAR_DIRECTION), reach * np.sin(BAR_DIRECTION)
        return f"""
        <mujoco>
          <option cone="elliptic" impratio="{FRICTION_STIFFNESS}"/>
          <worldbody>
            <body name="object">
              <freejoint name="object"/>
              <geom name="foot" type="cylinder" size="{FOOT_RADIUS} {0.5 * FOOT_HEIGHT}"
                pos="0 0 {bottom + 0.5 * FOOT_HEIGHT}" friction="{FOOT_FRICTION} 0.005 0.0001"
                density="1000"/>
              <geom name="body" type="capsule" size="{BODY_RADIUS}" density="1000" rgba="0.5 0.2 0.1 1"
                friction="{FRICTION} 0.005 0.0001"
                fromto="0 0 {bottom + FOOT_HEIGHT + BODY_RADIUS} 0 0 {bottom + BODY_TOP - BODY_RADIUS}"/>
              <body name="handle" pos="0 0 0">
                <joint name="hinge" axis="0 0 1" frictionloss="{HINGE_FRICTION}" damping="0.002"
                  solimpfriction="0.99 0.999 0.001"/>
                <geom name="shaft" type="capsule" size="{0.8 * BAR_RADIUS}" density="1000"
                  friction="{HANDLE_FRICTION} 0.005 0.0001"
                  fromto="0 0 {bottom + BODY_TOP - BODY_RADIUS} 0 0 {bar}"/>
                <geom name="bar" type="capsule" size="{BAR_RADIUS}" density="1000"
                  friction="{HANDLE_FRICTION} 0.005 0.0001" rgba="0.7 0.7 0.7 1"
                  fromto="{-x} {-y} {bar} {x} {y} {bar}"/>
              </body>
            </body>
          </worldbody>
        </mujoco>
        """

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        """Hold the base obliquely; bring the hand behind the near arm of the handle, level with it; circle.

        The same for both arms, half a turn apart: the handle looks alike from both sides.
        """
        arguments = np.zeros((len(observations), self.pairs.argument_count))
        scale = self.observation.get(observations, "object.size")[:, 2] / CORKSCREW_SIZE[2]
        for arm, side in enumerate((-1.0, 1.0)):
            arguments[:, self.pairs.columns(arm, 0).stop - 1] = EXPERT_APPROACH
            pose = self.pairs.columns(arm, 1).start
            arguments[:, pose] = side * 0.063 * scale
            arguments[:, pose + 1] = side * 0.077 * scale
            arguments[:, pose + 2] = EXPERT_POSE_HEIGHT * scale
            arguments[:, pose + 3 : pose + 6] = EXPERT_POSE_TURN
            arguments[:, self.pairs.columns(arm, 2).stop - 1] = 0.077 * scale
        return arguments
