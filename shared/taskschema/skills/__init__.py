"""The skill library (paper, Table II): parameterised controllers, one arm each."""

from taskschema.skills.argument import Argument
from taskschema.skills.registry import SKILLS, get_skill
from taskschema.skills.skill import Skill

__all__ = ["SKILLS", "Argument", "Skill", "get_skill"]
