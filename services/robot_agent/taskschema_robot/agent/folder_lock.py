"""One agent a folder: two would drive the same arms, and lease under the same name."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from taskschema.errors import ConfigError

LOCK_FILE = "agent.lock"


@contextmanager
def only_agent_of(folder: Path) -> Iterator[None]:
    """Hold a folder's lock; it ends with the process, however that ends.

    Raises:
        ConfigError: if another agent holds it.

    """
    lock = os.open(folder / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise ConfigError(
            f"Another agent works in {folder}: stop that one first, or name another folder with --folder."
        ) from None
    try:
        yield
    finally:
        os.close(lock)
