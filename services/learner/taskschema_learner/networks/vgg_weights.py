"""VGG16's published ImageNet weights as the trunk of the spatial network."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import safetensors
from safetensors.numpy import load as load_safetensors

from taskschema.arrays import AnyArray, Float32Array
from taskschema.errors import TrunkError
from taskschema.policies.spatial_trunk import TRUNKS
from taskschema_learner.networks.inert_pickle import read_state_dict

TORCHVISION_LAYERS = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21)
"""Numbers of the first ten convolutions in torchvision's `vgg16().features`."""
MAX_FILE_BYTES = 1024**3
"""VGG16's published file has 528 MiB."""


@dataclass(frozen=True)
class TrunkWeights:
    """What a file held for the trunk."""

    weights: dict[str, Float32Array]
    """By the network's own names, for example `trunk.0.weight` [64, 3, 3, 3]."""
    sha256: str
    """Of the whole file, in hexadecimal."""


def read_vgg_weights(path: Path) -> TrunkWeights:
    """Read torchvision's state dict of VGG16, as published or as safetensors; nothing in it is executed.

    Raises:
        TrunkError: if the file cannot be read, or names, shapes or numbers are not VGG16's.
    """
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise TrunkError(
                f"The weights {path} have more than {MAX_FILE_BYTES} bytes: VGG16's have 528 MiB."
            )
        data = path.read_bytes()
    except OSError as error:
        raise TrunkError(f"The weights {path} cannot be read: {error.strerror}.") from None
    try:
        arrays = _decode(data)
        weights = _trunk(arrays)
    except TrunkError as error:
        raise TrunkError(
            f"The weights {path} do not fit: {error}. Give torchvision's vgg16 state dict (.pth) or the same "
            "as .safetensors."
        ) from None
    return TrunkWeights(weights, hashlib.sha256(data).hexdigest())


def _decode(data: bytes) -> dict[str, AnyArray]:
    if data[8:9] == b"{":  # a safetensors file: the length of its JSON header, then the header
        try:
            return load_safetensors(data)
        except (safetensors.SafetensorError, KeyError) as error:
            raise TrunkError(f"it is no safetensors file ({error})") from None
    return read_state_dict(data)


def _trunk(arrays: dict[str, AnyArray]) -> dict[str, Float32Array]:
    """Return the first four blocks' weights under the network's names; the file's other layers are unused."""
    weights: dict[str, Float32Array] = {}
    for number, layer in zip(TORCHVISION_LAYERS, TRUNKS["vgg16"], strict=True):
        for part, shape in (("weight", layer.shape), ("bias", (layer.outputs,))):
            name = f"features.{number}.{part}"
            if name not in arrays:
                raise TrunkError(f"there is no {name}, but {', '.join(sorted(arrays)[:3]) or 'nothing'}")
            array = arrays[name]
            if array.shape != shape or array.dtype != np.float32:
                raise TrunkError(f"{name} is {array.dtype} {array.shape}, expected float32 {shape}")
            if not np.isfinite(array).all():
                raise TrunkError(f"{name} is not finite")
            weights[f"{layer.name}.{part}"] = np.array(array)
    return weights
