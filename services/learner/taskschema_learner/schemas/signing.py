"""The key that a run's owner signs schemas with (Ed25519), and the public key that others check them by."""

import base64
import os
import stat
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
    load_pem_public_key,
)

from taskschema.errors import SignatureError
from taskschema_learner.runs.run_folder import write_atomically

KEY_VARIABLE = "TASKSCHEMA_SIGNING_KEY"
"""Environment variable with the path of the owner's key, where it is not at its usual place."""
PUBLIC_SUFFIX = ".pub"
"""Added to the key's path: the public key, to be given to whoever checks signatures."""


def key_path() -> Path:
    """Return where the owner's private key lies: TASKSCHEMA_SIGNING_KEY, or below XDG_CONFIG_HOME."""
    given = os.environ.get(KEY_VARIABLE)
    if given:
        return Path(given)
    home = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    return Path(home) / "taskschema" / "signing-key.pem"


def owner_key() -> Ed25519PrivateKey:
    """Return the owner's private key, made at its first use: readable by its owner alone, unencrypted PEM.

    Raises:
        SignatureError: if it is not Ed25519, others may read it, or it cannot be read or made.
    """
    path = key_path()
    try:
        if not path.exists():
            _make(path)
        if path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise SignatureError(f"Others may read the signing key {path}: run `chmod 600 {path}`.")
        key = load_pem_private_key(path.read_bytes(), password=None)
    except OSError as error:
        raise SignatureError(
            f"The signing key {path} cannot be used: {error.strerror}. Set {KEY_VARIABLE} to another place."
        ) from None
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise SignatureError(f"{path} holds no unencrypted private key in PEM: move it away.") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise SignatureError(f"{path} is not an Ed25519 key: move it away, and a new one is made.")
    return key


def _make(path: Path) -> None:
    """Write a new private key, never readable by others, and its public key beside it."""
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    key = Ed25519PrivateKey.generate()
    write_atomically(path, key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    public = key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    write_atomically(path.with_name(path.name + PUBLIC_SUFFIX), public)


def read_public_key(path: Path) -> Ed25519PublicKey:
    """Return the public key in a PEM file.

    Raises:
        SignatureError: if the file cannot be read, or holds no Ed25519 public key.
    """
    try:
        key = load_pem_public_key(path.read_bytes())
    except OSError as error:
        raise SignatureError(f"The public key {path} cannot be read: {error.strerror}.") from None
    except (ValueError, UnsupportedAlgorithm):
        raise SignatureError(
            f"{path} holds no public key in PEM: give the owner's .pub file, never the private key."
        ) from None
    if not isinstance(key, Ed25519PublicKey):
        raise SignatureError(f"{path} is not an Ed25519 public key, which schemas are signed with.")
    return key


def public_text(key: Ed25519PublicKey) -> str:
    """Return a public key's 32 bytes in base64, as it stands in signed files."""
    return base64.b64encode(key.public_bytes(Encoding.Raw, PublicFormat.Raw)).decode()


def public_key_of(text: str) -> Ed25519PublicKey:
    """Return the key that `public_text` wrote; ValueError if it is none."""
    return Ed25519PublicKey.from_public_bytes(base64.b64decode(text, validate=True))


def is_signed_by(key: Ed25519PublicKey, signature: str, message: bytes) -> bool:
    """Whether a signature in base64 is this key's over the message."""
    try:
        key.verify(base64.b64decode(signature, validate=True), message)
    except (InvalidSignature, ValueError):
        return False
    return True
