"""Skill pairs: the discrete action, one skill for each arm, and the layout of their arguments."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray
from taskschema.errors import UnknownNameError
from taskschema.skills.argument import Argument
from taskschema.skills.skill import Skill
from taskschema.skills.table_space import TableRectangle, table_arguments

ARMS = ("left", "right")


class PairSpace:
    """The cross product X of a family's skills with itself, and one vector of all their arguments.

    Pair `i` is `(skills[i // S], skills[i % S])`, left arm first, for S skills. The argument vector holds
    the left arm's arguments, skill by skill, then the right arm's: A entries in all.

    With a `table`, locations are absolute ones on it, as where the object's pose is not known.
    """

    def __init__(self, skills: Sequence[Skill], table: TableRectangle | None = None) -> None:
        self.skills = tuple(skills)
        self.skill_arguments: tuple[tuple[Argument, ...], ...] = tuple(
            skill.arguments if table is None else table_arguments(skill, table) for skill in self.skills
        )
        """The arguments of each skill, in the order of `skills`."""
        names = [skill.name for skill in self.skills]
        self.pairs: tuple[tuple[str, str], ...] = tuple((left, right) for left in names for right in names)
        self.arguments: tuple[Argument, ...] = tuple(
            argument for _ in ARMS for arguments in self.skill_arguments for argument in arguments
        )
        self.argument_names: tuple[str, ...] = tuple(
            f"{arm}.{skill.name}.{argument.name}"
            for arm in ARMS
            for skill, arguments in zip(self.skills, self.skill_arguments, strict=True)
            for argument in arguments
        )

    def __len__(self) -> int:
        """Return |X|, the number of pairs."""
        return len(self.pairs)

    @property
    def argument_count(self) -> int:
        """A, the length of the argument vector."""
        return len(self.arguments)

    @cached_property
    def used(self) -> BoolArray:
        """[|X|, A] which arguments a pair uses; only these enter log-probability and entropy."""
        table = np.zeros((len(self.pairs), self.argument_count), dtype=bool)
        for row, pair in enumerate(self.pairs):
            for arm, skill in zip(ARMS, pair, strict=True):
                prefix = f"{arm}.{skill}."
                table[row] |= [name.startswith(prefix) for name in self.argument_names]
        return table

    def index(self, left: str, right: str) -> int:
        """Return the pair's index.

        Raises:
            UnknownNameError: if one of the skills is not allowed here.
        """
        names = [skill.name for skill in self.skills]
        for name in (left, right):
            if name not in names:
                raise UnknownNameError("skill", name, names)
        return names.index(left) * len(names) + names.index(right)

    def skill_index(self, pair: AnyArray, arm: int) -> AnyArray:
        """Return the index into `skills` that arm 0 (left) or 1 (right) runs, for pair indices [...]."""
        return pair // len(self.skills) if arm == 0 else pair % len(self.skills)

    def columns(self, arm: int, skill: int) -> slice:
        """Return where the arguments of skill number `skill` of arm 0 or 1 stand in the vector."""
        sizes = [len(arguments) for arguments in self.skill_arguments]
        start = arm * sum(sizes) + sum(sizes[:skill])
        return slice(start, start + sizes[skill])

    def named(self, pair: int, arguments: FloatArray) -> dict[str, float]:
        """Return those of the arguments [A] that a pair uses, by their names."""
        named = zip(self.argument_names, arguments.tolist(), self.used[pair], strict=True)
        return {name: value for name, value, used in named if used}

    @cached_property
    def _bounds(self) -> tuple[FloatArray, FloatArray, BoolArray]:
        return (
            np.array([argument.low for argument in self.arguments], dtype=np.float64),
            np.array([argument.high for argument in self.arguments], dtype=np.float64),
            np.array([argument.periodic for argument in self.arguments], dtype=bool),
        )

    def to_si(self, raw: AnyArray) -> FloatArray:
        """Map raw normalised samples [..., A] to SI units [m, rad]: angles wrap, the rest is clipped."""
        low, high, periodic = self._bounds
        values = np.asarray(raw, dtype=np.float64)
        wrapped = np.mod(values + 1.0, 2.0) - 1.0
        inside = np.where(periodic, wrapped, np.clip(values, -1.0, 1.0))
        return low + (inside + 1.0) * 0.5 * (high - low)

    def to_normalised(self, arguments: AnyArray) -> FloatArray:
        """Map SI arguments [..., A] to [-1, 1]: the inverse of `to_si` inside the search spaces."""
        low, high, _ = self._bounds
        return (np.asarray(arguments, dtype=np.float64) - low) / (high - low) * 2.0 - 1.0
