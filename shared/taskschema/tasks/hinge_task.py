"""What opening and rotating share: a stand and what turns on it about a vertical hinge."""

import itertools
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.kinematics.rotation import half_angle_cosine
from taskschema.tasks.scene_task import ObjectInstance, SceneTask

DENSITY = 1000.0
"""[kg/m^3] the paper varies location and size only."""
CORNERS = tuple(itertools.product((-1.0, 1.0), repeat=3))
"""Signs of x, y and scale at the corners of the randomisation."""


class HingeTask(SceneTask):
    """Turn the upper link of an object against the lower one, which keeps its pose.

    The object stands on the table by friction, and its hinge resists with more than that: unless somebody
    holds the lower link, the whole object turns and the hinge stays as it is.
    """

    object_joints: ClassVar[tuple[str, ...]] = ("hinge",)
    goal_in_passing: ClassVar[bool] = False
    """In passing, an object that falls rolls along a hand: its hinge turns before it has left its place."""
    scale_range: ClassVar[tuple[float, float]]
    """Factor on all its lengths, drawn uniformly."""
    hinge_goal: ClassVar[float]
    """How far the hinge must turn, counterclockwise seen from above [rad]."""
    position_tolerance: ClassVar[float]
    """Largest distance of the lower link from where it started [m]."""
    orientation_tolerance: ClassVar[float]
    """Largest angle, about any axis, between its orientation and the one it started with [rad]."""

    def draw_instance(self, generator: np.random.Generator) -> ObjectInstance:
        """Draw location and size, all uniform."""
        return self._instance(generator.uniform(-1.0, 1.0, 3))

    @property
    def corner_names(self) -> Sequence[str]:
        """The eight corners of location and size."""
        x_range, y_range = self.location_range
        return [
            f"x {x * x_range:+.2f} m, y {y * y_range:+.2f} m, size {self.scale_range[size > 0]:g}"
            for x, y, size in CORNERS
        ]

    def draw_corner(self, corner: int, generator: np.random.Generator) -> ObjectInstance:
        """Draw from the outer tenth of the ranges of location and size."""
        return self._instance(np.array(CORNERS[corner]) * generator.uniform(0.9, 1.0, 3))

    def _instance(self, place: AnyArray) -> ObjectInstance:
        """Return the object at `place` [3]: x, y and size, each from -1 to 1 over its range."""
        low, high = self.scale_range
        scale = low + 0.5 * (float(place[2]) + 1.0) * (high - low)
        return ObjectInstance(
            position=(
                float(place[0]) * self.location_range[0],
                float(place[1]) * self.location_range[1],
                0.5 * self.object_size[2] * scale,
            ),
            quaternion=(1.0, 0.0, 0.0, 0.0),
            density=DENSITY,
            scale=scale,
            joints=(0.0,),
        )

    def goal_reached(self, start: AnyArray, poses: AnyArray) -> BoolArray:
        """Test that the hinge has turned far enough on a lower link that is where it was."""
        return np.asarray(self.goal_distance(start, poses) == 0.0)

    def goal_distance(self, start: AnyArray, poses: AnyArray) -> FloatArray:
        """Return the share of the turn missing plus the lower link's excess shift and turn in tolerances."""
        turned = poses[..., 7] - start[:, None, 7]
        offset = poses[..., :3] - start[:, None, :3]
        x, y, z = offset[..., 0], offset[..., 1], offset[..., 2]
        shift = np.sqrt(x * x + y * y + z * z)
        angle = 2.0 * np.arccos(np.minimum(half_angle_cosine(poses[..., 3:7], start[:, None, 3:7]), 1.0))
        return np.asarray(
            np.maximum(1.0 - turned / self.hinge_goal, 0.0)
            + np.maximum(shift / self.position_tolerance - 1.0, 0.0)
            + np.maximum(angle / self.orientation_tolerance - 1.0, 0.0)
        )
