"""A frame whose pixels come when they are asked for."""

from collections.abc import Callable
from functools import cached_property

from taskschema_robot.camera.camera import Frame, Image


class FetchedFrame(Frame):
    """A `Frame` that fetches its image when that is first looked at: most are only asked for their age.

    Args:
        time: see `Frame`.
        number: see `Frame`.
        digest: see `Frame`; known without the image.
        fetch: returns the image.

    """

    def __init__(self, time: float, number: int, digest: int, fetch: Callable[[], Image]) -> None:
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "number", number)
        object.__setattr__(self, "_digest", digest)
        object.__setattr__(self, "_fetch", fetch)

    @cached_property
    def digest(self) -> int:
        """Of what is to be seen; see `Frame`."""
        digest: int = object.__getattribute__(self, "_digest")
        return digest

    @cached_property
    def image(self) -> Image:
        """[H, W, 3] at the camera's own resolution."""
        image: Image = object.__getattribute__(self, "_fetch")()
        return image
