"""What is written into a film's frames: the task, the step, and what each arm does."""

import cv2
import numpy as np

from taskschema_worker.rendering.frame import Frame

FONT = "sans"
"""Built into OpenCV."""
WEIGHT = 500
"""Of letters: 400 is regular, 700 bold."""
WHITE, GREY = (255, 255, 255), (205, 210, 216)
INK = (40, 48, 58)
GREEN, RED = (110, 231, 140), (255, 138, 128)
DARKENED = 0.38
"""Brightness of the picture behind text."""
LIGHTENED = 0.3
"""Of the picture's darkness, what is left behind the title."""
HEIGHT_SHARE, TEXT_SHARE = 0.105, 0.038
"""Height of the strip and of its letters, as shares of the frame's height."""


class Captions:
    """Writes into frames of one size."""

    def __init__(self, height: int) -> None:
        self._font = cv2.FontFace(FONT)
        self._size = max(11, round(TEXT_SHARE * height))
        self._strip = round(HEIGHT_SHARE * height)

    def write(self, frame: Frame, left: str, middle: str, right: str, outcome: bool | None) -> None:
        """Write a strip along the lower edge of a frame, in place.

        Args:
            frame: [H, W, 3] what is written into.
            left: the left arm's skill, at the left edge.
            middle: the step, in the middle.
            right: the right arm's skill, at the right edge.
            outcome: how the episode ended, which is written in its place; None: it goes on.

        """
        height, width = frame.shape[:2]
        frame[height - self._strip :] = (frame[height - self._strip :] * DARKENED).astype(np.uint8)
        line = height - self._strip // 2 + self._size // 3
        margin = self._size
        self._put(frame, left, (margin, line), WHITE)
        self._put(frame, right, (width - margin - self._width(right), line), WHITE)
        colour = GREY
        if outcome is not None:
            middle, colour = ("success", GREEN) if outcome else ("not solved", RED)
        self._put(frame, middle, ((width - self._width(middle)) // 2, line), colour)

    def title(self, frame: Frame, text: str) -> None:
        """Write a title into the upper left corner of a frame, in place."""
        margin = self._size
        corner = frame[: 2 * margin + margin // 2, : self._width(text) + 2 * margin]
        corner[:] = (255 - LIGHTENED * (255.0 - corner)).astype(np.uint8)
        self._put(frame, text, (margin, 2 * margin - margin // 3), INK)

    def _width(self, text: str) -> int:
        _, _, width, _ = cv2.getTextSize((1, 1), text, (0, 0), self._font, self._size, WEIGHT)
        return int(width)

    def _put(self, frame: Frame, text: str, place: tuple[int, int], colour: tuple[int, int, int]) -> None:
        cv2.putText(frame, text, place, colour, self._font, self._size, WEIGHT)
