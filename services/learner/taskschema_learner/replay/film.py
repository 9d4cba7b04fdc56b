"""Writing frames to a file: MP4 (H.264) for browsers, GIF for a README, or PNG of the last one."""

import io
import tempfile
from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path

from taskschema.errors import RenderingError
from taskschema_learner.runs.run_folder import write_atomically
from taskschema_worker.rendering.frame import Frame

FRAME_RATE = 25
"""Frames per second of an MP4: every fifth physics step of 8 ms, so that films run in real time."""
GIF_FRAME_RATE = 12.5
"""Frames per second of a GIF: its delays are whole hundredths of a second."""
GIF_COLOURS = 96
QUALITY = "21"
"""Constant rate factor of H.264: lower is better and larger."""


def frame_rate(path: Path) -> float:
    """Return the frames per second that a file of this name has.

    Raises:
        RenderingError: if nothing is known to write to such a name.

    """
    return _format(path)[0]


def write_film(path: Path, frames: Iterable[Frame]) -> None:
    """Write the frames; the file is there as a whole or not at all.

    Raises:
        RenderingError: if the name's ending is unknown, or there are no frames.
        RunFolderError: if the file cannot be written.

    """
    rate, encode = _format(path)
    images = list(frames)
    if not images:
        raise RenderingError("There is no frame to write: no episode took any time.")
    write_atomically(path, encode(images, rate))


def _format(path: Path) -> tuple[float, Callable[[list[Frame], float], bytes]]:
    formats: dict[str, tuple[float, Callable[[list[Frame], float], bytes]]] = {
        ".mp4": (FRAME_RATE, _mp4),
        ".gif": (GIF_FRAME_RATE, _gif),
        ".png": (FRAME_RATE, _png),
    }
    if path.suffix.lower() not in formats:
        raise RenderingError(f"{path} has no ending that is known: use {', '.join(formats)}.")
    return formats[path.suffix.lower()]


def _mp4(frames: list[Frame], rate: float) -> bytes:
    """Encode H.264 with 4:2:0 colours, its index first: what every browser plays as it loads."""
    import av

    height, width = frames[0].shape[:2]
    # Moving the index to the front reads the file again: it must have a name.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
            options = {"crf": QUALITY, "preset": "slow"}
            stream = container.add_stream("libx264", rate=Fraction(rate), options=options)
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            for image in frames:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            container.mux(stream.encode())
        return path.read_bytes()


def _gif(frames: list[Frame], rate: float) -> bytes:
    """Encode with one palette for all frames, so that what stands still costs nothing."""
    import numpy as np
    from PIL import Image

    sample = np.concatenate([*frames[:: max(1, len(frames) // 8)], frames[-1]])
    palette = Image.fromarray(sample).quantize(GIF_COLOURS, method=Image.Quantize.MEDIANCUT)
    images = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    buffer = io.BytesIO()
    first, *others = images
    duration = round(1000 / rate)
    first.save(buffer, "GIF", save_all=True, append_images=others, duration=duration, loop=0, optimize=True)
    return buffer.getvalue()


def _png(frames: list[Frame], rate: float) -> bytes:
    """Encode the last frame."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(frames[-1]).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()
