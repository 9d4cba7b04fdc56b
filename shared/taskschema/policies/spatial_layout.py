"""The action of the spatial network: for each arm a cell of the table, an offset inside it, and the rest."""

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.errors import ConfigError
from taskschema.skills.pairs import ARMS, PairSpace
from taskschema.skills.table_space import LOCATION

GRID = 8
"""Cells along each side of the response map (paper, Figure 4)."""
CELLS = GRID * GRID
CELL, OFFSET_X, OFFSET_Y, OTHERS = 0, 1, 2, 3
"""Where an arm's cell, its offsets and the first of its other arguments stand within the arm's part."""


class SpatialLayout:
    """What the R numbers of a raw action mean: R = 2 (3 + p), the left arm's part first.

    An arm's part holds the cell that was drawn, 0 to 63 row by row from the map's top left (the lowest x,
    the highest y); the offset of the location from the cell's centre along x and y, +-1 at the cell's edges;
    and the p other arguments of all its skills, normalised. The location is shared by the arm's skills.
    """

    def __init__(self, pairs: PairSpace) -> None:
        self.pairs = pairs
        """With the search spaces of images."""
        names = [
            f"{skill.name}.{argument.name}"
            for skill, arguments in zip(pairs.skills, pairs.skill_arguments, strict=True)
            for argument in arguments
            if argument.name not in LOCATION
        ]
        self.others: tuple[str, ...] = tuple(names)
        """Names `SKILL.ARGUMENT` of an arm's p other arguments."""
        if not any(argument.name in LOCATION for argument in pairs.arguments):
            raise ConfigError("No skill of this task takes a location: its policies cannot act on images.")
        self.arm_size = OTHERS + len(names)
        """3 + p"""
        self.size = len(ARMS) * self.arm_size
        """R"""
        self.used = self._used()
        """[|X|, R] what a pair's action consists of; an arm whose skill has no argument draws no cell."""

    @property
    def map_count(self) -> int:
        """2 + 4 + 2p, the filters of the network's last layer (paper, Figure 4)."""
        return len(ARMS) * (1 + 2 + len(self.others))

    def columns(self, arm: int) -> slice:
        """Return where arm 0 (left) or 1 (right) stands in a raw action."""
        return slice(arm * self.arm_size, (arm + 1) * self.arm_size)

    def _used(self) -> BoolArray:
        table = np.zeros((len(self.pairs), self.size), dtype=bool)
        for row, pair in enumerate(self.pairs.pairs):
            for arm, skill in enumerate(pair):
                names = self._argument_names(skill)
                part = table[row, self.columns(arm)]
                part[CELL] = bool(names)
                part[OFFSET_X : OFFSET_Y + 1] = [name in names for name in LOCATION]
                part[OTHERS:] = [other in {f"{skill}.{name}" for name in names} for other in self.others]
        return table

    def _argument_names(self, skill: str) -> list[str]:
        index = [item.name for item in self.pairs.skills].index(skill)
        return [argument.name for argument in self.pairs.skill_arguments[index]]

    def to_si(self, raw: AnyArray) -> FloatArray:
        """Map raw actions [..., R] to SI arguments [..., A]: offsets stay in their cell, angles wrap."""
        columns = []
        for name in self.pairs.argument_names:
            arm, skill, argument = name.split(".")
            part = raw[..., self.columns(ARMS.index(arm))]
            if argument in LOCATION:
                columns.append(_location(part, argument))
            else:
                columns.append(part[..., OTHERS + self.others.index(f"{skill}.{argument}")])
        return self.pairs.to_si(np.stack(columns, axis=-1))


def _location(part: AnyArray, axis: str) -> FloatArray:
    """Return where an arm's part [..., 3 + p] lies in the rectangle along x or y: [...], -1 to 1.

    With column c, counted from the left, and offset o:  -1 + (2 c + 1 + clip(o, -1, 1)) / 8.
    """
    cell = np.asarray(part[..., CELL], dtype=np.int64)
    place = cell % GRID if axis == "x" else GRID - 1 - cell // GRID
    offset = part[..., OFFSET_X if axis == "x" else OFFSET_Y].astype(np.float64)
    return np.asarray(-1.0 + (2.0 * place + 1.0 + np.clip(offset, -1.0, 1.0)) / GRID)
