"""A camera's intrinsics in a file."""

from pathlib import Path

import msgspec
import numpy as np

from taskschema_robot.camera.camera import Intrinsics
from taskschema_robot.errors import CameraError


class _Lens(msgspec.Struct, forbid_unknown_fields=True):
    width: int
    height: int
    """Of the pictures that it holds for [pixels]."""
    matrix: list[list[float]]
    distortion: list[float]
    residual: float
    """Of the calibration [pixels]."""


def write_lens(path: Path, intrinsics: Intrinsics, size: tuple[int, int], residual: float) -> None:
    """Write what a calibration found, for pictures of `size` (width, height)."""
    lens = _Lens(*size, intrinsics.matrix.tolist(), intrinsics.distortion.tolist(), residual)
    path.write_bytes(msgspec.json.format(msgspec.json.encode(lens), indent=2))


def read_lens(path: Path) -> tuple[Intrinsics, tuple[int, int]]:
    """Return intrinsics, and the size (width, height) of the pictures that they hold for.

    Raises:
        CameraError: if the file is missing or not such a file.

    """
    try:
        lens = msgspec.json.decode(path.read_bytes(), type=_Lens)
        matrix, distortion = np.array(lens.matrix), np.array(lens.distortion)
        if matrix.shape != (3, 3) or distortion.shape != (5,):
            raise ValueError("its matrix is 3 x 3, its distortion five numbers")
    except (OSError, msgspec.MsgspecError, ValueError) as error:
        raise CameraError(
            f"{path}: {error}. Make it with `taskschema-robot calibrate --lens FILE`."
        ) from None
    return Intrinsics(matrix, distortion), (lens.width, lens.height)
