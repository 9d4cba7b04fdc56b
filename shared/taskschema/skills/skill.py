"""The interface of a skill: what it is called, what it takes, and how it is planned."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from taskschema.skills.argument import Argument

if TYPE_CHECKING:
    from taskschema.arrays import FloatArray
    from taskschema.motion import ArmPath, PlanningContext


class Skill:
    """A parameterised controller for one arm (paper, Table II).

    A skill is planned when its step starts, for a batch of N episodes at once, into the path its arm
    follows. The plan knows neither MuJoCo nor ROS: simulation and robot drivers execute the same one.
    """

    name: ClassVar[str]
    """Name in snake case, as it stands in schemas."""
    summary: ClassVar[str]
    """One sentence for `taskschema skills`."""
    families: ClassVar[tuple[str, ...]] = ("all",)
    """Task families that allow it, or `("all",)`."""
    arguments: ClassVar[tuple[Argument, ...]] = ()
    """Its continuous arguments, in order."""
    start_state: ClassVar[str]
    """What it expects of arm and gripper."""
    end_state: ClassVar[str]
    """Where it leaves arm and gripper."""
    ends_pressing: ClassVar[bool | None] = False
    """Whether the arm may end pressing on something, which the next skill keeps up by starting from the arm's
    set-point and not from where it was held back. None: as it was before this skill."""

    def is_allowed_in(self, family: str) -> bool:
        """Return whether tasks of a family may have it."""
        return "all" in self.families or family in self.families

    def plan(self, context: PlanningContext, arguments: FloatArray) -> ArmPath:
        """Plan N episodes.

        Args:
            context: one arm's state, its kinematics and the object's pose, batch N.
            arguments: [N, p] the skill's own arguments in SI units, inside their search spaces.

        Returns:
            The path of the arm, within the robot's joint, velocity and acceleration limits. A target that
            cannot be reached is approached as near as it can be, position before orientation.

        Raises:
            NotImplementedError: if the skill belongs to a task without physics, which interprets it itself.
        """
        raise NotImplementedError(f"Skill {self.name!r} has no motion.")
