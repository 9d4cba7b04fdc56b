"""A schema as a portable file: what was learned, where it comes from, and its owner's signature."""

import base64
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from taskschema import __version__
from taskschema.config import RunConfig
from taskschema.errors import RunFolderError, SignatureError
from taskschema.schema import SchemaDocument
from taskschema_learner.runs.checkpoint import load_round
from taskschema_learner.runs.run_folder import RunFolder, write_atomically
from taskschema_learner.runs.run_hash import policy_hash
from taskschema_learner.schemas.signing import is_signed_by, public_key_of, public_text

SCHEMA_FILE_VERSION = 1
MAX_SCHEMA_BYTES = 8 * 1024 * 1024
"""No schema file is larger: the largest of this project's, of 3 x 64 logits, has some 20 KiB."""
TRIES = 10
"""A schema is read that often, should the checkpoint that it came with be gone when that is read."""


class Provenance(msgspec.Struct, frozen=True, kw_only=True):
    """Where a schema comes from."""

    run: str
    config: RunConfig
    config_hash: str
    """SHA-256 of the config, in hexadecimal."""
    policy_version: int
    """The number of updates behind it."""
    policy_sha256: str
    """Of that version's weights and logits, as `taskschema hash RUN` prints it."""
    taskschema_version: str
    exported_at: str
    """UTC, ISO 8601."""


class Signature(msgspec.Struct, frozen=True, kw_only=True):
    """Over the rest of the file, as JSON with sorted keys and no white space."""

    algorithm: str
    """`ed25519`."""
    public_key: str
    """32 bytes in base64: whose it claims to be."""
    value: str
    """64 bytes in base64."""


class SchemaFile(msgspec.Struct, frozen=True, kw_only=True):
    """What `taskschema schema RUN --export FILE` writes."""

    schema_file_version: int
    schema: SchemaDocument
    provenance: Provenance
    signature: Signature


def export_schema(folder: RunFolder, path: Path, key: Ed25519PrivateKey) -> SchemaFile:
    """Write a run's newest schema to a signed file and return what is in it.

    Raises:
        RunFolderError: if the run has none yet, it was changed, or the file cannot be written.
    """
    schema, policy_sha256 = _schema_and_hash(folder)
    provenance = Provenance(
        run=folder.name,
        config=folder.config,
        config_hash=folder.config.config_hash,
        policy_version=schema.version,
        policy_sha256=policy_sha256,
        taskschema_version=__version__,
        exported_at=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    unsigned = {"schema_file_version": SCHEMA_FILE_VERSION, "schema": schema, "provenance": provenance}
    signature = Signature(
        algorithm="ed25519",
        public_key=public_text(key.public_key()),
        value=base64.b64encode(key.sign(_message(msgspec.to_builtins(unsigned)))).decode(),
    )
    written = SchemaFile(
        schema_file_version=SCHEMA_FILE_VERSION, schema=schema, provenance=provenance, signature=signature
    )
    write_atomically(path, msgspec.json.format(msgspec.json.encode(written), indent=1))
    return written


def _schema_and_hash(folder: RunFolder) -> tuple[SchemaDocument, str]:
    """Return the newest schema and the hash of its own version's policy; a learner may be writing newer ones.

    Raises:
        RunFolderError: if there is no schema, or no checkpoint of it.
    """
    for _ in range(TRIES):
        schema = folder.read_schema()
        checkpoint = load_round(folder.checkpoints, schema.version)
        if checkpoint is not None and np.array_equal(checkpoint.arrays["schema.logits"], schema.logits):
            return schema, policy_hash(checkpoint)
    raise RunFolderError(
        f"schema.json in {folder.path} is not that of a checkpoint there: "
        "`taskschema train --resume` writes it again."
    )


def read_schema(path: Path, trusted: Ed25519PublicKey | None = None) -> SchemaDocument:
    """Return the schema in a file.

    Args:
        path: of a signed file, or, without a trusted key, of a bare schema such as `GET /schema` answers.
        trusted: the only key whose signature is accepted; None: whoever signed it, but a signature that
            is there must fit.

    Raises:
        RunFolderError: if the file cannot be read or is no schema.
        SignatureError: if it is not to be trusted.
    """
    data = _read(path)
    try:
        content = msgspec.json.decode(data, type=dict[str, Any])
        if "signature" not in content:
            document = msgspec.convert(content, SchemaDocument)
            if trusted is not None:
                raise SignatureError(
                    f"{path} is not signed, and a public key is configured: take a file that "
                    "`taskschema schema RUN --export FILE` wrote."
                )
            return document
        file = msgspec.convert(content, SchemaFile)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise RunFolderError(f"{path} is not a schema: {error}.") from None
    if file.schema_file_version != SCHEMA_FILE_VERSION:
        raise RunFolderError(
            f"{path} has schema file version {file.schema_file_version}, this is for {SCHEMA_FILE_VERSION}: "
            "export it again with this version of taskschema."
        )
    del content["signature"]
    _verify(path, file.signature, _message(content), trusted)
    return file.schema


def _verify(path: Path, signature: Signature, message: bytes, trusted: Ed25519PublicKey | None) -> None:
    if trusted is not None and signature.public_key != public_text(trusted):
        raise SignatureError(
            f"{path} is signed with another key ({signature.public_key[:60]}) than the configured one "
            f"({public_text(trusted)}): ask its owner, or configure their public key."
        )
    try:
        key = public_key_of(signature.public_key)
    except ValueError:
        raise SignatureError(f"{path} names no Ed25519 key in its signature: export it again.") from None
    if signature.algorithm != "ed25519" or not is_signed_by(key, signature.value, message):
        raise SignatureError(f"The signature of {path} does not fit: the file was altered. Export it again.")


def _message(content: dict[str, Any]) -> bytes:
    """Return what is signed: a file's content without its signature."""
    return msgspec.json.encode(content, order="sorted")


def _read(path: Path) -> bytes:
    try:
        if path.stat().st_size > MAX_SCHEMA_BYTES:
            raise RunFolderError(f"{path} is not a schema: it has more than {MAX_SCHEMA_BYTES} bytes.")
        return path.read_bytes()
    except OSError as error:
        raise RunFolderError(f"The schema {path} cannot be read: {error.strerror}.") from None
