"""Three more objects that the bar's schema lifts: a heavier bar, a rolling pin and a box.

`taskschema train --task-file docs/examples/carried.py:RollingPin --init-schema RUN --freeze-schema`
"""

from typing import ClassVar

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.kinematics.rotation import half_angle_cosine
from taskschema.tasks.lateral_lifting import CORNERS, LateralLifting
from taskschema.tasks.scene_task import ObjectInstance

LOCATION_RANGE = (0.05, 0.05)
"""The object's centre is drawn uniformly within +- these from the table's centre along x and y [m]."""
LIFT_GOAL = 0.15
"""Height gained [m]."""
TILT_LIMIT = 0.25
"""Largest tilt and turn on the way [rad]: one hand tilts it more."""


class Carried(LateralLifting):
    """An object that two arms lift by its ends: the family's skills and schema, with a shape of its own."""

    size: ClassVar[tuple[float, float, float]]
    """Edge lengths of its bounding box [m]."""
    yaw: ClassVar[float]
    """Angle of its x axis to the world's [rad]."""
    density_range: ClassVar[tuple[float, float]]
    """[kg/m^3]"""
    shape: ClassVar[str]
    """Its geoms, around the middle of its bounding box."""
    grasp: ClassVar[tuple[float, float]]
    """Where the left arm takes it, from its centre along its own x and y [m]; the right one, opposite."""
    closing: ClassVar[float]
    """Direction in which fingers close, from its own x axis [rad]."""
    location_range = LOCATION_RANGE

    @property
    def object_size(self) -> tuple[float, float, float]:
        """Length, width and height [m]."""
        return self.size

    @property
    def object_mjcf(self) -> str:
        """One body with a free joint."""
        body = f'<body name="object"><freejoint name="object"/>{self.shape}</body>'
        return f"<mujoco><worldbody>{body}</worldbody></mujoco>"

    @property
    def corner_names(self) -> list[str]:
        """The eight corners of place and density."""
        return [f"x {x:+.0f}, y {y:+.0f}, density {density:+.0f}" for x, y, density in CORNERS]

    def _instance(self, place: AnyArray) -> ObjectInstance:
        """Return the object for x, y and density, each from -1 to 1 over its range."""
        low, high = self.density_range
        return ObjectInstance(
            position=(
                float(place[0]) * LOCATION_RANGE[0],
                float(place[1]) * LOCATION_RANGE[1],
                0.5 * self.size[2],
            ),
            quaternion=(float(np.cos(0.5 * self.yaw)), 0.0, 0.0, float(np.sin(0.5 * self.yaw))),
            density=low + 0.5 * (float(place[2]) + 1.0) * (high - low),
        )

    def goal_reached(self, start: AnyArray, poses: AnyArray) -> BoolArray:
        """Test the goal at every moment of M motions: 15 cm higher, hardly tilted or turned."""
        return np.asarray(self.goal_distance(start, poses) == 0.0)

    def goal_distance(self, start: AnyArray, poses: AnyArray) -> FloatArray:
        """Return the share of the height missing plus the excess tilt in limits: 0 at the goal."""
        missing = np.maximum(LIFT_GOAL - (poses[..., 2] - start[:, None, 2]), 0.0) / LIFT_GOAL
        cosine = half_angle_cosine(poses[..., 3:], start[:, None, 3:])
        tilt = 2.0 * np.arccos(np.minimum(cosine, 1.0))
        return np.asarray(missing + np.maximum(tilt / TILT_LIMIT - 1.0, 0.0))

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        """Each arm takes its own end, then lifts by 25 cm."""
        turn = np.array([[np.cos(self.yaw), -np.sin(self.yaw)], [np.sin(self.yaw), np.cos(self.yaw)]])
        place = turn @ np.array(self.grasp)
        arguments = np.zeros((len(observations), self.pairs.argument_count))
        for arm, side in enumerate((1.0, -1.0)):
            x, y, angle = range(*self.pairs.columns(arm, 0).indices(arguments.shape[1]))
            arguments[:, x], arguments[:, y] = side * place
            arguments[:, angle] = np.mod(self.yaw + self.closing, 2.0 * np.pi)
            arguments[:, self.pairs.columns(arm, 1)] = 0.25
        return arguments


WOOD = 'density="1000" friction="1.0 0.005 0.0001" rgba="0.72 0.53 0.35 1"'
STEEL = 'density="1000" friction="1.05 0.005 0.0001" rgba="0.45 0.47 0.5 1"'
PLASTIC = 'density="1000" friction="1.05 0.005 0.0001" rgba="0.25 0.4 0.7 1"'


class HeavyBar(Carried):
    """A bar shorter, thicker and heavier than that of lateral lifting: 5.5 to 6.0 kg."""

    name = "heavy-bar"
    summary = "lift a heavy bar of varied place and density by 15 cm by its ends"
    size = (0.7, 0.02, 0.055)
    yaw = 0.25 * np.pi
    density_range = (7200.0, 7850.0)
    grasp = (-0.28, 0.0)
    closing = 0.5 * np.pi
    shape = f'<geom name="bar" type="box" size="0.35 0.01 0.0275" {STEEL}/>'


class RollingPin(Carried):
    """A roller with a handle at each end, on flats, so that it stays where it lies."""

    name = "rolling-pin"
    summary = "lift a rolling pin of varied place and density by 15 cm by its handles"
    size = (0.44, 0.05, 0.05)
    yaw = 0.25 * np.pi
    density_range = (700.0, 900.0)
    grasp = (-0.16, 0.0)
    closing = 0.5 * np.pi
    shape = f"""
        <geom name="roller" type="capsule" size="0.025 0.07" euler="0 1.5708 0" {WOOD}/>
        <geom name="flats" type="box" size="0.06 0.012 0.025" {WOOD}/>
        <geom name="handles" type="capsule" size="0.014 0.206" euler="0 1.5708 0" {WOOD}/>
    """


class Box(Carried):
    """An open box with two upright sides that hands can take; it is too wide for one hand."""

    name = "box"
    summary = "lift an open box of varied place and density by 15 cm by two of its sides"
    size = (0.34, 0.22, 0.12)
    yaw = 0.0
    density_range = (550.0, 700.0)
    grasp = (0.0, -0.102)
    closing = 0.5 * np.pi
    top_grasp_height = 0.3  # 24 mm below the rims
    shape = f"""
        <geom name="floor" type="box" size="0.17 0.094 0.01" pos="0 0 -0.05" {PLASTIC}/>
        <geom name="near" type="box" size="0.17 0.008 0.06" pos="0 -0.102 0" {PLASTIC}/>
        <geom name="far" type="box" size="0.17 0.008 0.06" pos="0 0.102 0" {PLASTIC}/>
    """
