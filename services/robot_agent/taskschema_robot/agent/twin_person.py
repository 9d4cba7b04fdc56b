"""What a twin does by itself that takes a person beside real robots."""

from typing import Protocol

from taskschema.arrays import FloatArray
from taskschema_robot.agent.twin_world import ObjectControl
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.judge import Judgement


class OutcomePerson(Protocol):
    """Who is asked what the camera cannot see."""

    def ask_outcome(self, judgement: Judgement) -> bool | None:
        """Ask what an unknown outcome is; None: nobody knows."""
        ...


class TwinPerson:
    """Puts the twin's object back, which nobody's hands can; see `ResetPerson`.

    Args:
        twin: whose object it is.
        watching: knows what the camera does not see; None: nobody does.

    """

    def __init__(self, twin: ObjectControl, watching: OutcomePerson | None = None) -> None:
        self._twin, self._watching = twin, watching

    def ask_reset(self, item: RobotObject, wanted: FloatArray, problem: str) -> None:
        """Put the object where it is wanted; see `ResetPerson`."""
        self._twin.place_object(wanted)

    def ask_outcome(self, judgement: Judgement) -> bool | None:
        """Ask who is watching; if nobody knows, the episode is dropped; see `ResetPerson`."""
        return None if self._watching is None else self._watching.ask_outcome(judgement)
