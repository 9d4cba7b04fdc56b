"""What an audit has counted so far, so that one that was stopped goes on."""

import hashlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import resources
from pathlib import Path

import msgspec

from taskschema.errors import ConfigError

CODE = ("taskschema", "taskschema_worker")
"""Packages that counts depend on."""
MADE_BY_AUDITS = "good_schemas"
"""Folder of what audits write themselves."""


class About(msgspec.Struct, frozen=True):
    """What counts depend on: those of anything else are of no use."""

    task: str
    task_source: str | None
    """Text of the user's own task file."""
    effort: str
    seed: int
    code: str
    """SHA-256 of the packages that an audit runs."""


class _Part(msgspec.Struct, frozen=True):
    part: str
    counts: list[int]


class Journal:
    """Counts by part, a line each in a file, in the order in which they came.

    Args:
        path: of the file; None: counts are not kept. A file about anything else is replaced.
        about: what the counts depend on.

    Raises:
        ConfigError: if the file cannot be read or written.

    """

    def __init__(self, path: Path | None = None, about: About | None = None) -> None:
        self._path = path
        self._known: dict[str, list[int]] = {}
        if path is None:
            return
        heading = msgspec.json.encode(about)
        try:
            lines = path.read_bytes().split(b"\n") if path.exists() else []
            if lines and lines[0] == heading:
                self._read(lines[1:])
            whole = [msgspec.json.encode(_Part(*item)) for item in self._known.items()]
            path.write_bytes(b"".join(line + b"\n" for line in [heading, *whole]))
        except OSError as error:
            raise ConfigError(f"{path} cannot be written: {error.strerror}.") from None

    def __len__(self) -> int:
        """Return how many parts are known."""
        return len(self._known)

    def counts(self, part: str, count: Callable[[], Sequence[int]]) -> list[int]:
        """Return a part's counts: the known ones, or else what `count` returns, which is then known."""
        if part not in self._known:
            self._known[part] = [int(number) for number in count()]
            if self._path is not None:
                with self._path.open("ab") as file:
                    file.write(msgspec.json.encode(_Part(part, self._known[part])) + b"\n")
        return self._known[part]

    def remove(self) -> None:
        """Remove the file: the audit is done."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)

    def _read(self, lines: Sequence[bytes]) -> None:
        """Take over whole lines; the last one may have been cut off."""
        with suppress(msgspec.MsgspecError):
            for line in lines:
                item = msgspec.json.decode(line, type=_Part)
                self._known[item.part] = item.counts


def code_sha256() -> str:
    """Return the SHA-256 of the packages that an audit runs, in hexadecimal."""
    digest = hashlib.sha256()
    for package in CODE:
        root = Path(str(resources.files(package)))
        for path in sorted(root.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts and MADE_BY_AUDITS not in path.parts:
                digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
