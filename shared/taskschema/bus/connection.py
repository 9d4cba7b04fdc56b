"""Connecting to Redis: one retry policy, and every failure as one line that says what to do."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import redis
from redis.backoff import EqualJitterBackoff
from redis.retry import Retry

from taskschema.bus.url import check_tls, without_secrets
from taskschema.errors import BusError

MINIMUM_VERSION = (6, 2)
"""Expired leases are claimed with XAUTOCLAIM, which came with 6.2."""
PATIENCE_SECONDS = 20.0
"""A command is tried again for about this long [s]: a server that restarts is waited for."""
ANSWER_SECONDS = 5.0
"""A server that does not answer a command within this long is not there [s]."""
LONGEST_BLOCK_MS = 10_000
"""No blocking read lasts longer [ms], so that the socket's own timeout finds a server that is gone."""


def connect(url: str, *, patience: float = PATIENCE_SECONDS) -> redis.Redis:
    """Connect to a server and check it.

    Args:
        url: `redis://`, `rediss://` (TLS; `?ssl_ca_certs=FILE` names the CA) or `unix://` URL, with user
            and password where it needs them.
        patience: for about how long a command is tried again once the server has answered [s].

    Raises:
        BusError: if there is no server, it refuses, or it is too old.

    """
    check_tls(url)
    try:
        with bus_errors(), _client(url, patience=0.0, timeout=ANSWER_SECONDS) as probe:
            version = str(probe.info("server").get("redis_version", "unknown"))
    except TypeError:  # redis-py passes the options of a URL on as they are
        raise BusError(
            f"The URL of Redis at {without_secrets(url)} has an option that is not known after its `?`: "
            "for TLS there are ssl_ca_certs, ssl_certfile and ssl_keyfile."
        ) from None
    numbers = re.match(r"(\d+)\.(\d+)", version)
    if numbers is None or tuple(map(int, numbers.groups())) < MINIMUM_VERSION:
        needed = ".".join(map(str, MINIMUM_VERSION))
        raise BusError(f"Redis at {without_secrets(url)} is version {version}: {needed} or newer is needed.")
    return _client(url, patience, LONGEST_BLOCK_MS / 1000 + ANSWER_SECONDS)


def _client(url: str, patience: float, timeout: float) -> redis.Redis:
    # Half to all of 0.5 s between tries, once they have become that rare.
    retry = Retry(EqualJitterBackoff(cap=0.5, base=0.02), retries=int(patience / 0.375) + 1)
    try:
        return redis.Redis.from_url(
            url,
            retry=retry,
            socket_connect_timeout=ANSWER_SECONDS,
            socket_timeout=timeout,
            socket_keepalive=True,
            health_check_interval=15,
            protocol=2,
        )
    except ValueError as error:
        raise BusError(
            f"{without_secrets(url)!r} is no Redis URL ({error}): use redis://USER:PASSWORD@HOST:PORT."
        ) from None


@contextmanager
def bus_errors() -> Iterator[None]:
    """Turn what redis-py raises into a BusError; usable as a decorator."""
    try:
        yield
    except (redis.AuthenticationError, redis.exceptions.NoPermissionError) as error:
        raise BusError(f"Redis refuses ({error}): check user and password in its URL.") from error
    except (redis.ConnectionError, redis.TimeoutError) as error:
        reason = _one_line(error)
        if "CERTIFICATE_VERIFY_FAILED" in reason:
            advice = "name the CA that signed its certificate with ?ssl_ca_certs=FILE in its URL"
        else:
            advice = "check that it runs and that its URL is right"
        raise BusError(f"Redis does not answer ({reason}): {advice}.") from error
    except redis.RedisError as error:
        raise BusError(f"Redis refuses a command: {_one_line(error)}.") from error


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300].rstrip(".") or type(error).__name__
