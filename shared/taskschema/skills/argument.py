"""Continuous arguments of skills and their search spaces (paper, Table III)."""

import math
from dataclasses import dataclass

from taskschema.errors import ConfigError


@dataclass(frozen=True)
class Argument:
    """One continuous argument of a skill, with the search space that policies act in.

    A policy emits it normalised: -1 is `low`, +1 is `high`. Periodic arguments wrap, others are clipped,
    and only for execution: the raw sample is what enters the log-probability.
    """

    name: str
    """Name within its skill, for example `x`."""
    unit: str
    """`m` or `rad`."""
    low: float
    """Lower end of the search space [unit]."""
    high: float
    """Upper end of the search space [unit]."""
    meaning: str
    """One sentence: what it does, in which frame."""
    periodic: bool = False
    """Whether `low` and `high` are the same value (a full turn)."""

    def __post_init__(self) -> None:
        if not -math.inf < self.low < self.high < math.inf:
            raise ConfigError(
                f"Argument {self.name!r}: low {self.low} must be below high {self.high}, both finite."
            )
