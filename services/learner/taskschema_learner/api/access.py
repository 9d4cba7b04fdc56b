"""Who may do what: tokens for whatever changes something, and for everything beyond loopback."""

from dataclasses import dataclass

from taskschema_learner.api.address import Address
from taskschema_learner.api.scopes import OPEN, Need, need_of
from taskschema_learner.api.tokens import Tokens


@dataclass(frozen=True)
class Access:
    """The rules for one address and its tokens."""

    address: Address
    tokens: Tokens

    def need(self, method: str, path: str) -> Need:
        """Return what a request needs here: reading on loopback needs nothing until somebody has a token."""
        need = need_of(method, path)
        if "read" not in need or not self.address.is_loopback or self.tokens.guards_reading:
            return need
        return OPEN

    def status(self, need: Need, authorization: str | None) -> int:
        """Return 200, 401 (no token, an unknown one, or one that has ended) or 403 (one of other scopes)."""
        if need == OPEN:
            return 200
        token = bearer_token(authorization)
        scopes = self.tokens.scopes_of(token) if token else frozenset()
        if not scopes:
            return 401
        return 200 if scopes & need else 403

    @property
    def hosts(self) -> list[str]:
        """Host headers that are answered.

        On loopback a foreign name means that a web page made its name resolve to this machine (DNS
        rebinding). Beyond loopback the names are the network's, and the tokens guard everything.
        """
        if not self.address.is_loopback:
            return ["*"]
        host = f"[{self.address.host}]" if ":" in self.address.host else self.address.host
        return ["127.0.0.1", "localhost", "[::1]", host]


def bearer_token(authorization: str | None) -> str:
    """Return the token in an Authorization header; empty if there is none."""
    scheme, _, given = (authorization or "").partition(" ")
    return given.strip() if scheme.lower() == "bearer" else ""
