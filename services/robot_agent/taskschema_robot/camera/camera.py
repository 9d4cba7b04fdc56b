"""The interface of a camera."""

import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""[H, W, 3] red, green, blue."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture."""

    time: float
    """When it was taken, on the agent's clock [s]: an age is `clock.now() - time`."""
    number: int
    """Counts up with every picture taken; a frozen camera repeats it."""
    image: Image
    """[H, W, 3] at the camera's own resolution."""

    @cached_property
    def digest(self) -> int:
        """Of what is to be seen: a working camera's noise makes every picture another one."""
        return zlib.crc32(np.ascontiguousarray(self.image).data)


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """How a camera projects, in the units of OpenCV's camera model."""

    matrix: NDArray[np.float64]
    """[3, 3] focal lengths and principal point [pixels]."""
    distortion: NDArray[np.float64]
    """[5] k1, k2, p1, p2, k3."""


class Camera(Protocol):
    """A camera that looks down on the table."""

    def latest(self) -> Frame:
        """Return the newest picture, without waiting for another one.

        Raises:
            CameraError: if there has been none.
        """

    def close(self) -> None:
        """Stop reading."""
