"""What a run is doing, as far as its folder tells: training, finished, or stopped."""

import fcntl
from typing import NamedTuple

import msgspec

from taskschema.bus.run_status import RunState
from taskschema_learner.runs.run_folder import LOCK, RunFolder, write_atomically

FINISH = "finished.json"
"""File of a run's end, in its folder."""


class _Finish(msgspec.Struct, frozen=True):
    version: int
    """Policy version at which the run finished: once it has another one, it went on."""
    reason: str


class FolderState(NamedTuple):
    """What a run is doing, and why."""

    state: RunState
    message: str


def mark_finished(folder: RunFolder, version: int, reason: str) -> None:
    """Note for good that a run finished at a policy version, and why.

    Raises:
        RunFolderError: if it cannot be written.
    """
    content = msgspec.json.format(msgspec.json.encode(_Finish(version, reason)), indent=1)
    write_atomically(folder.path / FINISH, content)


def folder_state(folder: RunFolder, version: int) -> FolderState:
    """Return what a run is doing whose newest policy version this is.

    A folder does not tell whether a learner is paused, or why one ended before the run had finished.
    """
    if _is_held(folder):
        return FolderState("running", "a learner is training it: ask its own API")
    finish = _read_finish(folder)
    if finish is not None and finish.version == version:
        return FolderState("finished", finish.reason)
    return FolderState("stopped", "its folder does not say that it finished")


def _is_held(folder: RunFolder) -> bool:
    """Return whether a learner holds the run's lock; looking takes it for a moment, shared."""
    try:
        with (folder.path / LOCK).open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # no learner has ever been there
        return False
    return False


def _read_finish(folder: RunFolder) -> _Finish | None:
    try:
        return msgspec.json.decode((folder.path / FINISH).read_bytes(), type=_Finish)
    except (OSError, msgspec.MsgspecError):
        return None
