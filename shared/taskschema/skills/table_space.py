"""Search spaces of images and the real robot: locations on the table (paper, Table III, right column)."""

import dataclasses
from dataclasses import dataclass

from taskschema.skills.argument import Argument
from taskschema.skills.skill import Skill

LOCATION = ("x", "y")
"""Names of the arguments that are one location for all skills of an arm."""
OWN_HEIGHT = "z"
"""An argument that there is not: a location on the table has none, its height is the skill's own."""
MARGIN = 0.1
"""[m] around every place of the object's centre: the search space that states have."""


@dataclass(frozen=True)
class TableRectangle:
    """A rectangle of the table's top, in the world frame."""

    x: tuple[float, float]
    """Lower and upper end [m]."""
    y: tuple[float, float]
    """Lower and upper end [m]."""

    @classmethod
    def around(cls, location_range: tuple[float, float]) -> "TableRectangle":
        """Return the smallest one that holds `MARGIN` around every place of an object's centre.

        Args:
            location_range: the centre lies within +- these distances from the table's centre [m].
        """
        half_x, half_y = (extent + MARGIN for extent in location_range)
        return cls((-half_x, half_x), (-half_y, half_y))


def table_arguments(skill: Skill, rectangle: TableRectangle) -> tuple[Argument, ...]:
    """Return a skill's arguments where the object's pose is not known: locations are in `rectangle`."""
    bounds = {"x": rectangle.x, "y": rectangle.y}
    found = []
    for argument in skill.arguments:
        if argument.name in LOCATION:
            low, high = bounds[argument.name]
            meaning = f"location on the table along the world's {argument.name} axis"
            argument = dataclasses.replace(argument, low=low, high=high, meaning=meaning)
        if argument.name != OWN_HEIGHT:
            found.append(argument)
    return tuple(found)
