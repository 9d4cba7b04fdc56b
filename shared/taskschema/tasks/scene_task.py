"""Tasks with a MuJoCo scene: two Sawyers at opposing ends of a table, and one object on it.

Nothing here needs the simulator: workers compose the scene, a robot agent uses the same task without one.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.errors import ConfigError
from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.rotation import vertical_turn
from taskschema.kinematics.sawyer import sawyer_pair
from taskschema.observation import ObservationLayout
from taskschema.skills.top_grasp import POINTING_DOWN
from taskschema.tasks.scene_observation import SceneGeometry, scene_layout
from taskschema.tasks.task import Task

HOME_SEED = (-0.45, -1.318, 0.0, 2.525, 0.0, 0.363, 1.27)
"""Joint angles near the home pose [rad]; the elbow is up, and the wrist in the middle of its range."""
HOME_DISTANCE = 0.2
"""From the table's centre line to each hand at the start of an episode [m]."""
HOME_HEIGHT = 0.14
"""Of the end effectors above the table at the start of an episode [m]."""


@dataclass(frozen=True)
class ObjectInstance:
    """What one episode's object is: drawn at its reset."""

    position: tuple[float, float, float]
    """Centre in the world frame [m]."""
    quaternion: tuple[float, float, float, float]
    """Orientation in the world frame, w x y z."""
    density: float
    """[kg/m^3]"""
    friction: float | None = None
    """Coefficient of sliding friction of the whole object; None: as its model says."""
    scale: float = 1.0
    """Factor on every length of the task's `object_mjcf`, about the object's centre."""
    joints: tuple[float, ...] = ()
    """Positions of the object's own joints [rad]."""

    @property
    def pose(self) -> FloatArray:
        """[7 + h] position, quaternion, and the positions of its h joints."""
        return np.array([*self.position, *self.quaternion, *self.joints])


class SceneTask(Task):
    """A task whose physics runs in MuJoCo: an object, how it varies, and the goal of its motion."""

    object_joints: ClassVar[tuple[str, ...]] = ()
    """The object's own joints, such as a hinge, in their order within `object_mjcf`."""
    top_grasp_height: ClassVar[float] = 0.0
    """Where a grasp from above takes the object: above its centre, as a share of its height."""
    side_grasp_height: ClassVar[float] = 0.0
    """Where a grasp from the side takes the object: above its centre, as a share of its height."""
    pose_height: ClassVar[float] = 0.0
    """Where a go-to pose without a height of its own goes: above the object's centre, as a share of its
    height. Policies on images name a place on the table, and no height."""
    lift_speed: ClassVar[float] = 0.45
    """At which arms lift [m/s]."""
    goal_in_passing: ClassVar[bool] = True
    """Whether an episode succeeds as soon as the goal holds along a motion; else it is tested where a step
    ends, as in the paper."""

    @property
    @abstractmethod
    def object_size(self) -> tuple[float, float, float]:
        """Edge lengths of the object at scale 1 in its own frame [m]: the observation's geometry."""

    @property
    @abstractmethod
    def object_mjcf(self) -> str:
        """The object as an MJCF model of density 1000 kg/m^3.

        One body `object`, its frame at the centre of its bounding box, with a free joint `object`; other
        links are its children, each with one joint. An `option` element's attributes replace the scene's.
        """

    @abstractmethod
    def draw_instance(self, generator: np.random.Generator) -> ObjectInstance:
        """Draw an episode's object."""

    @property
    @abstractmethod
    def corner_names(self) -> Sequence[str]:
        """The corners of the randomisation, each by its extremes."""

    @abstractmethod
    def draw_corner(self, corner: int, generator: np.random.Generator) -> ObjectInstance:
        """Draw an object from the outer tenth of every range at a corner: the audit tests every one."""

    @abstractmethod
    def goal_reached(self, start: AnyArray, poses: AnyArray) -> BoolArray:
        """Test the goal along a motion.

        Args:
            start: [M, 7 + h] the object's pose at the start of the episode: position, quaternion w x y z,
                and the positions of its h `object_joints`.
            poses: [M, S, 7 + h] its pose over time.

        Returns:
            [M, S] whether the goal holds.
        """

    @abstractmethod
    def goal_distance(self, start: AnyArray, poses: AnyArray) -> FloatArray:
        """Return how far from the goal a motion is, [M, S]; 0 where it holds. Audits search with it."""

    @cached_property
    def home_joints(self) -> FloatArray:
        """[2, 7] joint angles of both arms at the start of an episode [rad]: hands clear of the object."""
        rows = []
        for arm, side in zip(sawyer_pair(), (-1.0, 1.0), strict=True):
            position = np.array([[0.0, side * HOME_DISTANCE, HOME_HEIGHT]])
            rotation = vertical_turn(np.array([0.0 if side < 0 else np.pi])) @ POINTING_DOWN
            rows.append(solve_inverse(arm, position, rotation, np.array([HOME_SEED])).joints[0])
        return np.stack(rows)

    @cached_property
    def geometry(self) -> SceneGeometry:
        """What the observation and its scaling are relative to."""
        return SceneGeometry(self.object_size, self.home_joints, self.horizon, self.object_joints)

    @cached_property
    def observation(self) -> ObservationLayout:
        """The paper's low-dimensional state; see `scene_layout`."""
        return scene_layout(self.geometry)


def with_arms(task: Task) -> SceneTask:
    """Return a task that has arms, which a gate can stop.

    Raises:
        ConfigError: if it has none.
    """
    if isinstance(task, SceneTask):
        return task
    raise ConfigError(f"Task {task.name!r} has no arms that a gate could stop: leave --safety-gate out.")
