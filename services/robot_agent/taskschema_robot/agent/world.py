"""What the agent knows of the object, and who puts it back: a camera and a person, or a twin."""

from typing import Protocol

from taskschema.arrays import FloatArray
from taskschema.tasks.scene_task import ObjectInstance
from taskschema_robot.errors import RobotError
from taskschema_robot.reward.judge import Judgement


class EpisodeDroppedError(RobotError):
    """An episode that does not count: a fault, an unknown outcome, or a person's word."""


class NobodyThereError(EpisodeDroppedError):
    """A motion that was not begun, for nobody held the key: nothing is wrong but that."""


class SessionEndedError(EpisodeDroppedError):
    """A person who wants to end, before anything was done that could count."""


class World(Protocol):
    """The object on the table."""

    def reset(self, instance: ObjectInstance) -> FloatArray:
        """Have the object put where an episode starts; return its pose [7 + h] as found there.

        Raises:
            EpisodeDroppedError: if it is not to be had.
        """
        ...

    def object_pose(self) -> FloatArray | None:
        """Return the object's pose [7 + h] now; None if it is not known."""
        ...

    def judge(self, start: FloatArray, name: str) -> Judgement:
        """Judge the outcome so far, from `start` [7 + h]; unknown while hands hide the object, say.

        `name` is the step's, for what is kept as evidence.
        """
        ...

    def ask(self, judgement: Judgement) -> Judgement:
        """Return what a person says an unknown outcome is; the judgement itself if nobody knows."""
        ...

    def last_look(self, start: FloatArray, name: str) -> Judgement:
        """Judge the outcome of an episode that is over, with the hands withdrawn; may ask a person.

        Only where the hands held nothing in the air: what they put down is not where the outcome left it.
        """
        ...
