"""The skill library (paper, Table II): parameterised controllers, one arm each.

`skills.registry` lists them; `skills.pairs` combines them for two arms.
"""

from taskschema.skills.argument import Argument
from taskschema.skills.skill import Skill

__all__ = ["Argument", "Skill"]
