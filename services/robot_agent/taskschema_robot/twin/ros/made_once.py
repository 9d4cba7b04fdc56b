"""What is made when it is first wanted, and then kept."""

from collections.abc import Callable
from typing import Generic, TypeVar

Made = TypeVar("Made")


class MadeOnce(Generic[Made]):
    """Calls `make` when it is first called itself, and returns the same from then on.

    `functools.cache` does as much, but costs more to set up than most messages here cost to make.
    """

    __slots__ = ("_made", "_make")

    def __init__(self, make: Callable[[], Made]) -> None:
        self._make = make
        self._made: list[Made] = []

    def __call__(self) -> Made:
        """Return it."""
        if not self._made:
            self._made.append(self._make())
        return self._made[0]
