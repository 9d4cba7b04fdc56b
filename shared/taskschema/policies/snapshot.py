"""One policy version: weights and schema logits, as they are published and hashed."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
import safetensors
from safetensors.numpy import load, save

from taskschema.arrays import AnyArray, Float32Array, FloatArray
from taskschema.errors import WireError

_LOGITS = "schema.logits"


@dataclass(frozen=True)
class PolicySnapshot:
    """The policy after `version` updates."""

    version: int
    weights: dict[str, Float32Array]
    """Arrays of the network by name, for example `trunk.0.weight` [64, D]."""
    logits: FloatArray
    """[T, |X|] schema logits."""

    @cached_property
    def sha256(self) -> str:
        """Hash over names, shapes and bytes of weights and logits, in hexadecimal."""
        digest = hashlib.sha256()
        arrays: dict[str, AnyArray] = {**self.weights, _LOGITS: self.logits}
        for name in sorted(arrays):
            array = np.ascontiguousarray(arrays[name])
            digest.update(f"{name}:{array.dtype.str}:{array.shape};".encode())
            digest.update(array.tobytes())
        return digest.hexdigest()

    def to_bytes(self) -> bytes:
        """Encode as safetensors."""
        arrays: dict[str, AnyArray] = {**self.weights, _LOGITS: self.logits}
        return save(
            {name: np.ascontiguousarray(array) for name, array in arrays.items()},
            metadata={"version": str(self.version), "sha256": self.sha256},
        )

    @classmethod
    def from_bytes(cls, data: bytes) -> "PolicySnapshot":
        """Decode safetensors bytes, whose hash must match.

        Raises:
            WireError: if they are not a policy snapshot, or altered.
        """
        try:
            arrays = load(data)
            metadata = _metadata(data)
            snapshot = cls(int(metadata["version"]), arrays, arrays.pop(_LOGITS))
        except (safetensors.SafetensorError, KeyError, ValueError) as error:
            raise WireError(f"not a policy snapshot: {error}") from None
        if snapshot.sha256 != metadata.get("sha256"):
            raise WireError("policy snapshot: its hash does not match its content")
        return snapshot


def _metadata(data: bytes) -> dict[str, str]:
    """Return the metadata that safetensors keeps in its JSON header."""
    size = int.from_bytes(data[:8], "little")
    header = msgspec.json.decode(data[8 : 8 + size], type=dict[str, dict[str, object]])
    return {key: str(value) for key, value in header.get("__metadata__", {}).items()}
