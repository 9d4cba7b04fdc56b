"""The URL of a Redis: it holds a password, which nobody else is to see."""

import os
import sys
from collections.abc import Sequence
from urllib.parse import parse_qs, urlsplit

from taskschema.errors import BusError

REDIS_VARIABLE = "TASKSCHEMA_REDIS_URL"
"""Environment variable with the URL: other users of the machine cannot read it there."""
OPTION = "--redis"


def without_secrets(url: str) -> str:
    """Return a URL without user, password and options."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"


def check_tls(url: str) -> None:
    """Return if a `rediss://` URL says nothing against checking the server's certificate.

    Raises:
        BusError: if it does: whoever stands between could then pose as the server.

    """
    required = parse_qs(urlsplit(url).query).get("ssl_cert_reqs", ["required"])
    if required != ["required"]:
        raise BusError(
            f"ssl_cert_reqs={required[0]} in the Redis URL would trust any server: "
            "name its CA with ssl_ca_certs=FILE instead."
        )


def hide_password() -> None:
    """Start this program again with the URL in its environment, if a password stands on its command line.

    What stands on a command line is shown by `ps` to every user of the machine.
    """
    words, url = taken_out(sys.argv[1:])
    if url is None:
        return
    os.environ[REDIS_VARIABLE] = url
    before = sys.orig_argv[: len(sys.orig_argv) - len(sys.argv[1:])]
    os.execv(sys.executable, [*before, *words])


def taken_out(words: Sequence[str]) -> tuple[list[str], str | None]:
    """Return the words without a `--redis URL` that holds a password, and the last such URL."""
    rest: list[str] = []
    found = None
    waiting = list(words)
    while waiting:
        word = waiting.pop(0)
        name, equals, value = word.partition("=")
        if name != OPTION or not (equals or waiting):
            rest.append(word)
            continue
        url = value if equals else waiting.pop(0)
        if "@" in url:
            found = url
        else:
            found, rest = None, [*rest, OPTION, url]
    return rest, found
