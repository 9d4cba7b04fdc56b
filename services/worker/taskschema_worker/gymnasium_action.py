"""Reading the actions that gymnasium's users send: what cannot be run is refused, by name."""

from typing import Any

import numpy as np
from gymnasium.error import InvalidAction

from taskschema.arrays import AnyArray, BoolArray, FloatArray, IntArray
from taskschema.skills.pairs import PairSpace

Action = dict[str, Any]
"""`{"pair": index into X, "arguments": [A] float32 in [-1, 1]}`."""


def read_action(space: PairSpace, action: Action, acting: BoolArray) -> tuple[IntArray, FloatArray]:
    """Return the pairs [...] and SI arguments [..., A] of an action, or of as many as `acting` has entries.

    Args:
        space: pairs and search spaces; what lies outside [-1, 1] is brought inside.
        action: of one environment or of several.
        acting: [...] which of them run it; what the others are told is not looked at.

    Raises:
        InvalidAction: that says what is valid, if one has another shape or type, names a pair that there is
            not, or holds an argument that is not finite.
    """
    pairs = _part(action, "pair", acting.shape, "iu", "integer")
    arguments = _part(action, "arguments", (*acting.shape, space.argument_count), "fiu", "number")
    unknown = acting & ((pairs < 0) | (pairs >= len(space)))
    if unknown.any():
        valid = "; ".join(f"{index}: {left}, {right}" for index, (left, right) in enumerate(space.pairs))
        raise InvalidAction(f"There is no skill pair {pairs[unknown][0]}. Valid: {valid}.")
    bad = acting[..., None] & ~np.isfinite(arguments)
    if bad.any():
        place = tuple(np.argwhere(bad)[0])
        name = space.argument_names[place[-1]]
        raise InvalidAction(f"Argument {name} is {arguments[place]}: take a finite number, from -1 to 1.")
    return pairs.astype(np.int64), space.to_si(arguments)


def _part(action: Action, name: str, shape: tuple[int, ...], kinds: str, what: str) -> AnyArray:
    """Return one part of an action as an array of this shape."""
    try:
        part = np.asarray(action[name])
    except (KeyError, IndexError, TypeError, ValueError):
        raise InvalidAction('An action is {"pair": ..., "arguments": ...}: see action_space.') from None
    if part.shape != shape or part.dtype.kind not in kinds:
        wanted = f"an array of shape {shape}, of {what}s" if shape else f"one {what}"
        raise InvalidAction(
            f"action[{name!r}] must be {wanted}; got shape {part.shape} of type {part.dtype}."
        )
    return part
