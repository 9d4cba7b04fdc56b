"""Checkpoints: one checksummed file each, written whole or not at all."""

import hashlib
import logging
import os
import re
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
import safetensors
from safetensors.numpy import load as load_safetensors
from safetensors.numpy import save as save_safetensors

from taskschema.arrays import AnyArray
from taskschema.errors import RunFolderError

log = logging.getLogger("taskschema.learner")

_FORMAT = "1"
_NAME = re.compile(r"round-(\d{8})-([0-9a-f]{64})\.safetensors")
_TEMPORARY = ".part"


@dataclass(frozen=True)
class Checkpoint:
    """Everything that a run continues from."""

    round: int
    """Rounds completed; the next one to open."""
    token: int
    """Fencing token of the learner that wrote it."""
    arrays: dict[str, AnyArray]
    """Named arrays, such as `Learner.arrays()`."""
    metadata: dict[str, str] = field(default_factory=dict)
    """Whatever else belongs to it, as text."""


class _Header(msgspec.Struct):
    metadata: dict[str, str] = msgspec.field(name="__metadata__")


def save(folder: Path, checkpoint: Checkpoint, keep: int = 3) -> Path:
    """Write a checkpoint durably, then remove all but the newest `keep`; return its path.

    The file's name holds its round and the SHA-256 of its content. It gets that name only after its content
    is on the disk, so a file of that name is whole unless something altered it later.

    Raises:
        RunFolderError: if it cannot be written; earlier checkpoints are then as they were.

    """
    data = _encode(checkpoint)
    path = folder / f"round-{checkpoint.round:08d}-{hashlib.sha256(data).hexdigest()}.safetensors"
    temporary = path.with_suffix(_TEMPORARY)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for leftover in folder.glob(f"*{_TEMPORARY}"):  # of a learner that was killed while it wrote
            leftover.unlink()
        _write(temporary, path, data)
        for old in _by_round(folder)[keep:]:
            old.unlink()
    except OSError as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise RunFolderError(
            f"The checkpoint of round {checkpoint.round} cannot be written to {folder}: {error.strerror}. "
            "Make room or fix the folder, then continue with --resume."
        ) from None
    return path


def load_latest(folder: Path) -> Checkpoint | None:
    """Return the newest checkpoint that is whole, or None if there has never been one.

    One that is truncated or altered is refused with a warning in the log, and the one before it is used.

    Raises:
        RunFolderError: if there are checkpoints, but none that is whole.

    """
    paths = _by_round(folder)
    for path in paths:
        try:
            return _read(path)
        except (OSError, ValueError) as error:
            log.warning("Checkpoint %s is refused: %s. Trying the one before it.", path.name, error)
    if paths:
        raise RunFolderError(
            f"None of the {len(paths)} checkpoints in {folder} is whole: restore one from a backup, "
            "or start again with another --run-dir."
        )
    return None


def load_round(folder: Path, number: int) -> Checkpoint | None:
    """Return the checkpoint after this many rounds, or None if it is not kept, or not whole."""
    for path in folder.glob(f"round-{number:08d}-*.safetensors"):
        with suppress(OSError, ValueError):
            return _read(path)
    return None


def _encode(checkpoint: Checkpoint) -> bytes:
    own = {"format": _FORMAT, "round": str(checkpoint.round), "token": str(checkpoint.token)}
    metadata = {**own, **{f"user.{name}": text for name, text in checkpoint.metadata.items()}}
    arrays = {name: np.ascontiguousarray(array) for name, array in checkpoint.arrays.items()}
    # scalars stay scalars: ascontiguousarray would make them one-dimensional
    arrays = {name: array.reshape(checkpoint.arrays[name].shape) for name, array in arrays.items()}
    return save_safetensors(arrays, metadata=metadata)


def _write(temporary: Path, path: Path, data: bytes) -> None:
    with temporary.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)
    descriptor = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _by_round(folder: Path) -> list[Path]:
    """Return the checkpoints of a folder, newest round first; of one round, the last written first."""
    if not folder.is_dir():
        return []
    found = [path for path in folder.iterdir() if _NAME.fullmatch(path.name)]
    return sorted(found, key=lambda path: (path.name[:14], path.stat().st_mtime_ns), reverse=True)


def _read(path: Path) -> Checkpoint:
    """Return a checkpoint, or raise ValueError or OSError with the reason why not."""
    data = path.read_bytes()
    match = _NAME.fullmatch(path.name)
    if match is None or hashlib.sha256(data).hexdigest() != match[2]:
        raise ValueError("its content does not match the checksum in its name")
    try:
        header = msgspec.json.decode(data[8 : 8 + int.from_bytes(data[:8], "little")], type=_Header)
        arrays = load_safetensors(data)
    except (msgspec.MsgspecError, safetensors.SafetensorError) as error:
        raise ValueError(f"it is no checkpoint ({error})") from None
    metadata = header.metadata
    if metadata.get("format") != _FORMAT:
        raise ValueError(f"its format is {metadata.get('format')}, this program reads {_FORMAT}")
    user = {name.removeprefix("user."): text for name, text in metadata.items() if name.startswith("user.")}
    return Checkpoint(int(metadata["round"]), int(metadata["token"]), arrays, user)
