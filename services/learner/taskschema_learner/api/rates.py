"""How often one client address may ask."""

import os
from collections.abc import Mapping
from dataclasses import dataclass

from limits import RateLimitItem, parse

from taskschema.errors import ConfigError

DEFAULTS = {
    "TASKSCHEMA_API_REQUEST_LIMIT": "1000/second",
    "TASKSCHEMA_API_CHANGE_LIMIT": "20/second",
    "TASKSCHEMA_API_FAILURE_LIMIT": "30/minute",
}
"""Environment variables, and what they are if not set."""


@dataclass(frozen=True)
class Rates:
    """Limits for each client address; behind a proxy that is the proxy's."""

    requests: RateLimitItem
    """Requests of any kind."""
    changes: RateLimitItem
    """Requests that change something."""
    failures: RateLimitItem
    """Wrong tokens, after which every request that needs one is refused."""

    @classmethod
    def of(cls, environment: Mapping[str, str] = os.environ) -> "Rates":
        """Return the limits of an environment.

        Raises:
            ConfigError: if one is not understood.
        """
        return cls(*(_parse(name, environment.get(name, text)) for name, text in DEFAULTS.items()))


def _parse(name: str, text: str) -> RateLimitItem:
    try:
        return parse(text)
    except ValueError:
        raise ConfigError(f"{name} is a number and a time, such as {DEFAULTS[name]}; got {text!r}.") from None
