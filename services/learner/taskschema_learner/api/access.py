"""Who may do what: a bearer token for whatever changes something, and for everything beyond loopback."""

import hmac
import secrets
from dataclasses import dataclass

from taskschema.errors import ConfigError
from taskschema_learner.api.address import Address

TOKEN_VARIABLE = "TASKSCHEMA_API_TOKEN"
"""Environment variable that holds the token; unset: one is generated and printed."""
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
OPEN_PATHS = frozenset({"/healthz", "/readyz"})
"""Answered without a token everywhere, for probes: they tell nothing about runs."""
READING_POSTS = frozenset({"/act"})
"""Change nothing, although they are sent with POST."""


def new_token() -> str:
    """Return a random token (192 bits)."""
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Access:
    """The rules for one address and token.

    Raises:
        ConfigError: if the token cannot be sent in a header.
    """

    address: Address
    token: str

    def __post_init__(self) -> None:
        if not self.token or not all(33 <= ord(character) <= 126 for character in self.token):
            raise ConfigError(f"{TOKEN_VARIABLE} must be printable ASCII without spaces, and not empty.")

    def needs_token(self, method: str, path: str) -> bool:
        """Return whether a request needs the token."""
        if path in OPEN_PATHS:
            return False
        changes = method not in SAFE_METHODS and path not in READING_POSTS
        return changes or not self.address.is_loopback

    def accepts(self, authorization: str | None) -> bool:
        """Return whether an Authorization header carries the token; takes the same time for any other."""
        scheme, _, given = (authorization or "").partition(" ")
        matches = hmac.compare_digest(given.strip().encode(), self.token.encode())
        return matches and scheme.lower() == "bearer"

    @property
    def hosts(self) -> list[str]:
        """Host headers that are answered.

        On loopback a foreign name means that a web page made its name resolve to this machine (DNS
        rebinding). Beyond loopback the names are the network's, and the token guards everything.
        """
        if not self.address.is_loopback:
            return ["*"]
        host = f"[{self.address.host}]" if ":" in self.address.host else self.address.host
        return ["127.0.0.1", "localhost", "[::1]", host]
