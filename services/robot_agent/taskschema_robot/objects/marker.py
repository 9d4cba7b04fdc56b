"""Printed ArUco markers: which one sits where."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.errors import ConfigError

DICTIONARY = "DICT_4X4_50"
"""Of cv2.aruco: few bits, so that the cells are large; 50 markers are enough."""
COUNT = 50
TABLE_MARKERS = range(40, 46)
"""Numbers of the markers that are fixed to the table; objects use those below."""


@dataclass(frozen=True)
class Marker:
    """One printed marker; on its face x points to the right of the picture, y up, z out of it."""

    number: int
    """Within the dictionary."""
    size: float
    """Edge length of the black square [m]."""
    position: tuple[float, float, float]
    """Its centre in its link's frame, or the table's [m]."""
    x_axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    """Where its picture's right points, in that frame."""
    y_axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """Where its picture's top points."""

    def __post_init__(self) -> None:
        if not 0 <= self.number < COUNT or not self.size > 0.0:
            raise ConfigError(f"Marker {self.number} of {self.size} m: numbers go from 0 to {COUNT - 1}.")
        if abs(np.dot(self.x_axis, self.y_axis)) > 1e-6:
            raise ConfigError(f"Marker {self.number}: its axes must be at right angles.")

    @property
    def corners(self) -> FloatArray:
        """[4, 3] top left, top right, bottom right, bottom left, in its link's frame [m]: cv2's order."""
        half = 0.5 * self.size
        x, y = (half * np.asarray(axis) for axis in (self.x_axis, self.y_axis))
        return np.asarray(self.position) + np.stack([y - x, y + x, -y + x, -y - x])


def table_markers(size: float = 0.08) -> tuple[Marker, ...]:
    """Return the six markers on the table, three along each side between the robots.

    Any four of them give the table's frame: hands and objects hide some in passing.
    """
    places = [(x, y) for x in (-0.46, 0.46) for y in (-0.3, 0.0, 0.3)]
    return tuple(
        Marker(number, size, (x, y, 0.0)) for number, (x, y) in zip(TABLE_MARKERS, places, strict=True)
    )
