"""What a twin does by itself that takes a person beside real robots."""

from taskschema.arrays import FloatArray
from taskschema_robot.agent.twin_world import ObjectControl
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.judge import Judgement


class TwinPerson:
    """Puts the twin's object back, and does not know what the camera does not see; see `ResetPerson`."""

    def __init__(self, twin: ObjectControl) -> None:
        self._twin = twin

    def ask_reset(self, item: RobotObject, wanted: FloatArray, problem: str) -> None:
        """Put the object where it is wanted; see `ResetPerson`."""
        self._twin.place_object(wanted)

    def ask_outcome(self, judgement: Judgement) -> bool | None:
        """Answer that nobody knows: the episode is dropped; see `ResetPerson`."""
        return None
