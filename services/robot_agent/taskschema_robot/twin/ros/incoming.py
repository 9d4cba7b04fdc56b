"""How rosbridge makes JSON objects out of a client's frames."""

import json
from collections.abc import Iterator
from typing import Any


class DeafenedError(Exception):
    """A frame that ends the bridge's input thread for its client: nothing it sends has an effect any more."""


class FrameBuffer:
    """The unread text of one client.

    rosbridge joins frames until they decode, and finds an object among garbage by trying every opening brace
    with every closing one. A broken object that holds a complete one therefore stays in the buffer for good:
    every later frame meets the inner object first.
    """

    def __init__(self) -> None:
        self._text = ""

    def objects(self, text: str) -> Iterator[Any]:
        """Yield what a frame makes available; the caller handles each before the next is looked for."""
        self._text += text
        before = None
        while self._text and self._text != before:
            before = self._text
            found = self._next()
            if found is None:
                return
            yield found
            if before == self._text:
                return

    def _next(self) -> Any | None:  # noqa: ANN401 - any JSON
        try:
            whole = json.loads(self._text)
        except ValueError:
            return self._first_inside()
        self._text = ""
        return whole

    def _first_inside(self) -> Any | None:  # noqa: ANN401
        opening = [index for index, letter in enumerate(self._text) if letter == "{"]
        closing = [index for index, letter in enumerate(self._text) if letter == "}"]
        for start in opening:
            inner = None
            for end in closing:
                try:
                    candidate = json.loads(self._text[start : end + 1])
                except ValueError:
                    continue
                inner = candidate
                if "op" in candidate:
                    self._text = self._text[end + 1 :]
                    return candidate
            if inner is not None:
                return inner
        return None
