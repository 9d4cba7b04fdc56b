"""What every request needs: the one table that gate, description and tests go by."""

from typing import Literal, get_args

from starlette.routing import compile_path

Scope = Literal["read", "control", "robot"]
"""`read`: look at runs; `control`: change what they do; `robot`: fetch a policy and act with it."""
SCOPES: tuple[Scope, ...] = get_args(Scope)
Need = frozenset[Scope]
"""Scopes of which a token must have one; none: the request needs no token."""

OPEN: Need = frozenset()
READ: Need = frozenset({"read"})
ACT: Need = frozenset({"read", "robot"})
CONTROL: Need = frozenset({"control"})

NEEDS: dict[tuple[str, str], Need] = {
    ("GET", "/healthz"): OPEN,
    ("GET", "/readyz"): OPEN,
    ("GET", "/"): READ,
    ("GET", "/docs"): READ,
    ("GET", "/docs/oauth2-redirect"): READ,
    ("GET", "/openapi.json"): READ,
    ("GET", "/metrics"): READ,
    ("GET", "/events"): READ,
    ("GET", "/runs"): READ,
    ("GET", "/runs/{run}"): READ,
    ("GET", "/runs/{run}/curve"): READ,
    ("GET", "/workers"): READ,
    ("GET", "/schema"): ACT,
    ("GET", "/policy"): ACT,
    ("GET", "/policy/meta"): ACT,
    ("POST", "/act"): ACT,
    ("PUT", "/workers"): CONTROL,
    ("POST", "/runs/{run}/pause"): CONTROL,
    ("POST", "/runs/{run}/resume"): CONTROL,
    ("POST", "/runs/{run}/stop"): CONTROL,
}
"""Need of each method and path. What is not here, answered or not, needs `read` or, if it could change
something, `control`."""

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_TEMPLATES = [(method, compile_path(path)[0], need) for (method, path), need in NEEDS.items() if "{" in path]


def need_of(method: str, path: str) -> Need:
    """Return what a request needs."""
    exact = NEEDS.get((method, path))
    if exact is not None:
        return exact
    for known, pattern, need in _TEMPLATES:
        if known == method and pattern.fullmatch(path):
            return need
    return READ if method in SAFE_METHODS else CONTROL


def methods_of(path: str) -> list[str]:
    """Return the methods that a path is asked with."""
    exact = {method for method, known in NEEDS if known == path}
    return sorted(exact | {method for method, pattern, _ in _TEMPLATES if pattern.fullmatch(path)})
