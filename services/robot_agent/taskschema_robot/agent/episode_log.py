"""The agent's own log: a robot's episodes, which nobody can compute again, until a checkpoint has them."""

import os
from pathlib import Path

import msgspec

from taskschema.bus.messages import WorkItem
from taskschema.errors import WireError
from taskschema.trajectory import Trajectory, TrajectoryFormat, decode_slot, encode_slot
from taskschema_robot.errors import RobotError


class _Entry(msgspec.Struct, frozen=True):
    item: WorkItem
    data: bytes
    """As `encode_slot` makes them."""


class _Attempts(msgspec.Struct):
    round: int
    slot: int
    attempts: int


class EpisodeLog:
    """Keeps episodes in a folder, one file each; written whole or not at all.

    Args:
        folder: of one run's log.
        expected: what the run's trajectories look like.

    """

    def __init__(self, folder: Path, expected: TrajectoryFormat) -> None:
        self._folder = folder
        self._expected = expected
        folder.mkdir(parents=True, exist_ok=True)

    def keep(self, item: WorkItem, trajectories: list[Trajectory]) -> None:
        """Keep a slot's episodes; they are on the disk when this returns."""
        entry = _Entry(item, encode_slot(trajectories))
        self._write(self._place(item), msgspec.msgpack.encode(entry))

    def find(self, item: WorkItem) -> list[Trajectory] | None:
        """Return the episodes kept for a slot, if they were run on the policy that is asked for.

        Raises:
            RobotError: if the file is damaged; it is never guessed at.

        """
        path = self._place(item)
        if not path.exists():
            return None
        try:
            entry = msgspec.msgpack.decode(path.read_bytes(), type=_Entry)
            if entry.item != item:
                return None
            return decode_slot(entry.data, self._expected)
        except (msgspec.MsgspecError, WireError) as error:
            raise RobotError(
                f"{path} is damaged ({error}): move it away; its episode is run again."
            ) from None

    def forget(self, version: int) -> int:
        """Remove what the checkpoint of a policy version covers: the rounds before it; return how many."""
        covered = [path for path in self._folder.glob("*.episode") if _round_of(path) < version]
        for path in [*covered, *(p for p in self._folder.glob("*.attempts") if _round_of(p) < version)]:
            path.unlink(missing_ok=True)
        return len(covered)

    def __len__(self) -> int:
        """Return how many episodes are kept."""
        return len(list(self._folder.glob("*.episode")))

    def attempts(self, item: WorkItem) -> int:
        """Return how often this slot's episode was dropped before."""
        path = self._place(item).with_suffix(".attempts")
        return msgspec.json.decode(path.read_bytes(), type=_Attempts).attempts if path.exists() else 0

    def drop(self, item: WorkItem) -> int:
        """Note that an episode was dropped, and return how often it has been."""
        attempts = self.attempts(item) + 1
        path = self._place(item).with_suffix(".attempts")
        self._write(path, msgspec.json.encode(_Attempts(item.round, item.slot, attempts)))
        return attempts

    def _place(self, item: WorkItem) -> Path:
        return self._folder / f"{item.round:06d}-{item.slot:06d}.episode"

    def _write(self, path: Path, data: bytes) -> None:
        part = path.with_suffix(".part")
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)


def _round_of(path: Path) -> int:
    return int(path.name.partition("-")[0])
