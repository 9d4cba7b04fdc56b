"""What a policy of a run observes on the robot, and what its arguments mean."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.tasks.scene_observation import observe
from taskschema.tasks.scene_task import SceneTask
from taskschema_robot.drivers.driver import ArmState


class Observer(Protocol):
    """One kind of observation, `RunConfig.observation`."""

    def begin(self) -> None:
        """Note that an episode begins."""
        ...

    def observe(self, states: Sequence[ArmState], pose: FloatArray, step: int) -> AnyArray:
        """Return the observation [1, ...] in the very values that are streamed.

        Args:
            states: of both arms, left first.
            pose: [7 + h] the object's.
            step: 0..T-1.

        Raises:
            EpisodeDroppedError: if there is none.
        """
        ...

    def skill_arguments(self, arguments: FloatArray, pose: FloatArray) -> FloatArray:
        """Return what skills are planned from, [A'], of a policy's SI arguments [A]."""
        ...


class StateObserver:
    """The low-dimensional state; see `Observer`.

    Args:
        task: of the run.
        size: [3] of the object [m].

    """

    def __init__(self, task: SceneTask, size: FloatArray) -> None:
        self._task = task
        self._size = size

    def begin(self) -> None:
        """Do nothing; see `Observer`."""

    def observe(self, states: Sequence[ArmState], pose: FloatArray, step: int) -> AnyArray:
        """Return the state [1, D] in float32; see `Observer`."""
        observation = observe(
            self._task.geometry,
            np.stack([state.positions for state in states])[None],
            np.stack([state.velocities for state in states])[None],
            pose[None],
            self._size[None],
            np.array([step]),
        )
        return observation.astype(np.float32)

    def skill_arguments(self, arguments: FloatArray, pose: FloatArray) -> FloatArray:
        """Return the arguments as they are: offsets from the object; see `Observer`."""
        return arguments
