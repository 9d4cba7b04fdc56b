"""Layout, units and scaling of the low-dimensional state observation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taskschema.arrays import AnyArray, Float32Array


@dataclass(frozen=True)
class ObservationField:
    """A named run of numbers in the observation vector."""

    name: str
    size: int
    unit: str
    """SI unit, or `1` for a pure number."""
    meaning: str
    """One sentence, with the frame."""
    center: float | tuple[float, ...] = 0.0
    """Value that the networks see as 0 [unit]."""
    scale: float | tuple[float, ...] = 1.0
    """Distance from the center that the networks see as 1 [unit]."""


class ObservationLayout:
    """The observation vector of D numbers, field by field.

    Observations travel in SI units; `to_network` applies the fixed scaling just before a network.
    """

    def __init__(self, fields: Sequence[ObservationField]) -> None:
        self.fields = tuple(fields)
        self.size = sum(field.size for field in self.fields)
        """D, the length of the vector."""

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where each field stands in the vector."""
        ends = np.cumsum([field.size for field in self.fields]).tolist()
        return {
            field.name: slice(end - field.size, end) for field, end in zip(self.fields, ends, strict=True)
        }

    def get(self, observations: AnyArray, name: str) -> AnyArray:
        """Return field `name` [..., size] of observations [..., D]."""
        return observations[..., self.slices[name]]

    @cached_property
    def _affine(self) -> tuple[Float32Array, Float32Array]:
        centers = [np.broadcast_to(np.asarray(field.center), field.size) for field in self.fields]
        scales = [np.broadcast_to(np.asarray(field.scale), field.size) for field in self.fields]
        return np.concatenate(centers).astype(np.float32), np.concatenate(scales).astype(np.float32)

    def to_network(self, observations: AnyArray) -> Float32Array:
        """Scale SI observations [..., D] for networks: (value - center) / scale, at most +-10."""
        center, scale = self._affine
        scaled = (np.asarray(observations, dtype=np.float32) - center) / scale
        limited: Float32Array = np.clip(scaled, -10.0, 10.0)
        return limited
