"""A folder of files about steps and faults, of which the newest are kept."""

from collections import deque
from itertools import count
from pathlib import Path

from taskschema.randomness import EpisodeKey


class KeptFiles:
    """Names new files, overwrites none, those of earlier sessions included, and removes the oldest.

    Args:
        folder: of the files; made with the first.
        suffix: of their names, with its dot.
        most: how many are kept.

    """

    def __init__(self, folder: Path, suffix: str, most: int) -> None:
        self._folder, self._suffix, self._most = folder, suffix, most
        found = sorted(folder.glob(f"*{suffix}"), key=lambda path: path.stat().st_mtime_ns)
        self._kept = deque(found)

    def place(self, name: str) -> Path:
        """Return where a new file is to be written: `name`, with a number if there is one already."""
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"{name}{self._suffix}"
        numbers = count(2)
        while path.exists():
            path = self._folder / f"{name}-{next(numbers)}{self._suffix}"
        self._kept.append(path)
        while len(self._kept) > self._most:
            self._kept.popleft().unlink(missing_ok=True)
        return path


def step_name(key: EpisodeKey, step: int | str) -> str:
    """Return what a step's files are called: round, slot, attempt and step."""
    return f"{key.round:06d}-{key.slot:06d}-{key.attempt}-{step}"
