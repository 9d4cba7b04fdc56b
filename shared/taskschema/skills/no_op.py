"""No-op: the arm stays as it is."""

from typing import ClassVar

from taskschema.arrays import FloatArray
from taskschema.motion import ArmPath, PlanningContext
from taskschema.skills.skill import Skill


class NoOp(Skill):
    """Hold the arm and its gripper still for as long as the other arm's skill takes."""

    name: ClassVar[str] = "no_op"
    summary: ClassVar[str] = "hold still while the other arm moves"
    families: ClassVar[tuple[str, ...]] = ("all",)
    start_state: ClassVar[str] = "Any."
    end_state: ClassVar[str] = "As it started: arm still, gripper set-point unchanged."
    ends_pressing: ClassVar[bool | None] = None

    def plan(self, context: PlanningContext, arguments: FloatArray) -> ArmPath:
        """Plan a path of no duration; a step lasts as long as the longer of its two skills."""
        return ArmPath.stay(context.joints, context.opening)
