"""Frames: what the overhead camera sees, and what no working camera delivers."""

import numpy as np
from numpy.typing import NDArray

from taskschema.arrays import AnyArray
from taskschema.errors import FrameError

Frames = NDArray[np.uint8]
"""[N, 256, 256, 3] red, green, blue; the first row is the top: the world's x to the right, y up."""
FRAME_SIZE = 256
"""Height and width of a frame [pixel] (paper, section IV-C)."""
FRAME_SHAPE = (FRAME_SIZE, FRAME_SIZE, 3)
FRAME_DTYPE = "|u1"
BLACK = 8
"""A frame whose brightest value is below this is black: a lamp or a camera is off, or a cap is on."""


def check_frames(frames: AnyArray) -> None:
    """Check frames [N, ...] one by one: size, type, and that something is to be seen.

    Raises:
        FrameError: if one cannot come from a working camera; the message says why.
    """
    if frames.dtype != np.uint8:
        raise FrameError(f"a frame holds {frames.dtype}, expected uint8: values 0 to 255, not 0 to 1")
    if frames.shape[1:] != FRAME_SHAPE:
        raise FrameError(f"a frame has shape {frames.shape[1:]}, expected {FRAME_SHAPE}: rows, columns, RGB")
    for index, frame in enumerate(frames):
        if frame.max() < BLACK:
            raise FrameError(f"frame {index} is black: the camera is covered, or the light is off")


def check_alive(first_frames: AnyArray) -> None:
    """Check that the first frames [N, 256, 256, 3] of N episodes, each with its object elsewhere, differ.

    Raises:
        FrameError: if all of several are the same to the last bit.
    """
    if len(first_frames) > 1 and (first_frames == first_frames[:1]).all():
        raise FrameError(f"the frames of {len(first_frames)} episodes are the same: the camera is frozen")


def check_colour_order(frames: AnyArray) -> None:
    """Check that frames [N, 256, 256, 3] of a wooden table, which is more red than blue, are so.

    Raises:
        FrameError: if red and blue look exchanged.
    """
    for index, frame in enumerate(frames):
        if np.median(frame[..., 0]) < np.median(frame[..., 2]):
            raise FrameError(f"frame {index} shows a blue table: its colours are in the order BGR, not RGB")
