"""Every skill by its name: adding one is a new file and one line here."""

from taskschema.errors import UnknownNameError
from taskschema.skills.go_to_pose import GoToPose
from taskschema.skills.lift import Lift
from taskschema.skills.no_op import NoOp
from taskschema.skills.rotate import Rotate
from taskschema.skills.side_grasp import SideGrasp
from taskschema.skills.skill import Skill
from taskschema.skills.top_grasp import TopGrasp
from taskschema.skills.twist import Twist


class SkillTable(dict[str, Skill]):
    """Skills by name; to look up one that there is not raises an error that lists those that there are."""

    def __missing__(self, name: str) -> Skill:
        raise UnknownNameError("skill", name, self)


SKILLS = SkillTable(
    {skill.name: skill for skill in (TopGrasp(), SideGrasp(), GoToPose(), Lift(), Twist(), Rotate(), NoOp())}
)


def get_skill(name: str) -> Skill:
    """Return the skill called `name`.

    Raises:
        UnknownNameError: if there is none; the message lists the valid ones.
    """
    return SKILLS[name]
