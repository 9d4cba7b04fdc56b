"""The object in a twin: put back by a request, seen by the twin's own word or by its camera."""

from typing import Protocol

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema_robot.agent.start_pose import start_pose
from taskschema_robot.clock import Clock
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.judge import Judgement, Outcome

SETTLE_SECONDS = 0.2
"""Simulated time for the object to come to rest after it was put back [s]."""


class ObjectControl(Protocol):
    """What a twin lets its client do with the object."""

    def place_object(self, pose: FloatArray) -> None:
        """Put it at a pose [7 + h]."""
        ...

    def object_pose(self) -> FloatArray:
        """Return where it really is [7 + h]."""
        ...


class TrueWorld:
    """The twin's own word: the stand-in for pictures while training on states.

    Args:
        twin: that simulates the object.
        task: whose goal decides.
        item: the object on its table.
        clock: the agent's.

    """

    def __init__(self, twin: ObjectControl, task: SceneTask, item: RobotObject, clock: Clock) -> None:
        self._twin = twin
        self._item = item
        self._task = task
        self._clock = clock

    def reset(self, instance: ObjectInstance) -> FloatArray:
        """Put the object where the episode starts; see `World`."""
        self._twin.place_object(start_pose(self._item, instance))
        self._clock.sleep_until(self._clock.now() + SETTLE_SECONDS)
        return self._twin.object_pose()

    def object_pose(self) -> FloatArray:
        """Return the true pose; see `World`."""
        return self._twin.object_pose()

    def judge(self, start: FloatArray, name: str) -> Judgement:
        """Judge by the true pose; see `World`."""
        pose = self._twin.object_pose()
        if not np.isfinite(pose).all():
            return Judgement(Outcome.UNKNOWN, "the twin has lost the object")
        reached = bool(self._task.goal_reached(start[None], pose[None, None])[0, 0])
        outcome = Outcome.SUCCESS if reached else Outcome.FAILURE
        return Judgement(outcome, "by the twin's own word", pose)

    def ask(self, judgement: Judgement) -> Judgement:
        """Know no more than before; see `World`."""
        return judgement

    def last_look(self, start: FloatArray, name: str) -> Judgement:
        """Judge as before; see `World`."""
        return self.judge(start, name)
