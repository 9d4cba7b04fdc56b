"""The API's tokens: what each may do, and until when."""

import hashlib
import hmac
import os
import secrets
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import msgspec

from taskschema.errors import ConfigError
from taskschema_learner.api.scopes import SCOPES, Scope

VARIABLES: Mapping[str, frozenset[Scope]] = {
    "TASKSCHEMA_API_TOKEN": frozenset({"read", "control"}),
    "TASKSCHEMA_API_READ_TOKEN": frozenset({"read"}),
    "TASKSCHEMA_API_ROBOT_TOKEN": frozenset({"robot"}),
}
"""Environment variables that hold a token, and its scopes."""
TOKEN_VARIABLE = "TASKSCHEMA_API_TOKEN"
"""The one that is generated and printed if it is not set."""
FILE_VARIABLE = "TASKSCHEMA_API_TOKENS_FILE"
"""Environment variable with the path of a file of further tokens, which `taskschema token` writes."""
LONGEST_NAME = 100
"""Characters of a holder's name."""


def new_token() -> str:
    """Return a random token (192 bits)."""
    return secrets.token_urlsafe(24)


def digest(token: str) -> str:
    """Return a token's SHA-256: a random token of 192 bits needs no slower hash."""
    return hashlib.sha256(token.encode(errors="surrogatepass")).hexdigest()


class StoredToken(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A token as it is kept: by its hash, so that whoever reads the file cannot use it."""

    name: Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST_NAME)]
    """Who holds it."""
    sha256: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]
    scopes: frozenset[Scope]
    expires: datetime | None = None
    """When it ends; None: never."""

    def is_valid(self, now: datetime) -> bool:
        """Return whether it has not ended."""
        return self.expires is None or now < self.expires


class TokensFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Content of a file of tokens (JSON)."""

    tokens: tuple[StoredToken, ...] = ()


class Tokens:
    """The tokens that an API accepts: from the environment, and from a file that is read when it changes."""

    def __init__(self, given: Iterable[StoredToken], file: Path | None = None) -> None:
        """Take tokens, and read the file.

        Raises:
            ConfigError: if the file cannot be read.
        """
        self._given = tuple(given)
        self._file = file
        self._changed = 0
        self._stored: tuple[StoredToken, ...] = ()
        self._is_lost = False
        self._refresh()

    @classmethod
    def of(cls, token: str, environment: Mapping[str, str] = os.environ) -> "Tokens":
        """Return the tokens of an environment, with this one as `TASKSCHEMA_API_TOKEN`.

        Raises:
            ConfigError: if one cannot be sent in a header, or the file cannot be read.
        """
        values = {**environment, TOKEN_VARIABLE: token}
        given = [stored(name, values[name], scopes) for name, scopes in VARIABLES.items() if name in values]
        path = environment.get(FILE_VARIABLE)
        return cls(given, Path(path) if path else None)

    @property
    def guards_reading(self) -> bool:
        """Whether somebody may have been given a token to read with: then nobody reads without one."""
        self._refresh()
        return self._is_lost or any(
            "read" in token.scopes and token.name != TOKEN_VARIABLE for token in (*self._given, *self._stored)
        )

    def scopes_of(self, token: str) -> frozenset[Scope]:
        """Return what a token may do, nothing for one that is unknown or has ended.

        Takes the same time wherever it differs, and however many match.
        """
        self._refresh()
        given, now = digest(token), datetime.now(UTC)
        found: frozenset[Scope] = frozenset()
        for known in (*self._given, *self._stored):
            if hmac.compare_digest(known.sha256, given) and known.is_valid(now):
                found |= known.scopes
        return found

    def _refresh(self) -> None:
        if self._file is None:
            return
        try:
            changed = self._file.stat().st_mtime_ns
            if changed != self._changed or self._is_lost:
                self._stored = read_tokens(self._file).tokens
                self._changed, self._is_lost = changed, False
        except (OSError, ConfigError) as error:
            if self._changed == 0:
                raise ConfigError(f"The tokens in {self._file} cannot be read: {error}") from None
            self._stored, self._is_lost = (), True  # a file that is gone or damaged lets nobody in


def read_tokens(path: Path) -> TokensFile:
    """Read a file of tokens.

    Raises:
        ConfigError: if it is no such file; OSError if it cannot be read.
    """
    try:
        return msgspec.json.decode(path.read_bytes(), type=TokensFile)
    except msgspec.MsgspecError as error:
        raise ConfigError(
            f"{path} is no file of tokens ({error}): write it with `taskschema token`."
        ) from None


def stored(name: str, token: str, scopes: Iterable[Scope], expires: datetime | None = None) -> StoredToken:
    """Return a token as it is kept.

    Raises:
        ConfigError: if it cannot be sent in a header, or nobody is named.
    """
    if not 1 <= len(name) <= LONGEST_NAME:
        raise ConfigError(f"A token's holder needs a name of 1 to {LONGEST_NAME} characters.")
    if not token or not all(33 <= ord(character) <= 126 for character in token):
        raise ConfigError(f"{name} must be printable ASCII without spaces, and not empty.")
    return StoredToken(name, digest(token), frozenset(scopes), expires)


def valid_scopes(names: Iterable[str]) -> frozenset[Scope]:
    """Return the scopes of these names.

    Raises:
        ConfigError: if one is none.
    """
    wanted = frozenset(names)
    if not wanted or not wanted <= set(SCOPES):
        raise ConfigError(
            f"A token's scopes are some of {', '.join(SCOPES)}; got {', '.join(wanted) or 'none'}."
        )
    return frozenset(scope for scope in SCOPES if scope in wanted)
