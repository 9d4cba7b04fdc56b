"""A run, served from its folder."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from taskschema.bus.counters import RunCounters
from taskschema.bus.records import FIRST_EVENT, PublishedPolicy, Request
from taskschema.bus.run_status import RunStatus
from taskschema.bus.worker_info import WorkerInfo
from taskschema.config import RunConfig
from taskschema.errors import RunFolderError, UnknownNameError, WireError
from taskschema.metrics import RoundMetrics
from taskschema.policies import PolicySnapshot
from taskschema_learner.api.problems import ConflictError, NotFoundError
from taskschema_learner.runs.folder_state import folder_state
from taskschema_learner.runs.run_folder import RunFolder

_TRAINING = "This run is training, and its folder takes no requests: send them to its own API."


class FolderSource:
    """Reads one run's folder; nothing in it is ever changed.

    Raises:
        RunFolderError: if there is no run in the folder, or it is damaged.
    """

    def __init__(self, path: Path) -> None:
        self._folder = RunFolder.open(path)

    def ping(self) -> None:
        """Return if the folder is there.

        Raises:
            RunFolderError: if it is not.
        """
        RunFolder.open(self._folder.path)

    def runs(self) -> list[str]:
        """Return the name of the folder."""
        return [self._folder.name]

    def config(self, run: str) -> RunConfig:
        """Return the run's configuration."""
        self._require(run)
        return self._folder.config

    def status(self, run: str) -> RunStatus:
        """Return whether the run is training, finished or stopped, since when, and after how many rounds."""
        latest = self.latest(run)
        version = 0 if latest is None else latest.policy_version
        state, message = folder_state(self._folder, version)
        return RunStatus(
            run=run,
            state=state,
            round=0 if latest is None else latest.round,
            version=version,
            message=f"served from the run's folder: {message}",
            started_at=_changed(self._folder.path / "config.json"),
            updated_at=_changed(self._folder.path / "metrics.csv"),
        )

    def schema(self, run: str, version: int | None = None) -> bytes:
        """Return the last schema: the folder keeps no older ones."""
        self._require(run)
        if not (self._folder.path / "schema.json").exists():
            raise NotFoundError(f"Run {run!r} has no schema yet: train it first.")
        document = self._folder.read_schema()
        if version not in (None, document.version):
            raise NotFoundError(f"The folder of run {run!r} keeps schema version {document.version} only.")
        return msgspec.json.encode(document)

    def policy(self, run: str) -> PublishedPolicy:
        """Return the last policy."""
        self._require(run)
        path = self._folder.path / "policy.safetensors"
        if not path.exists():
            raise NotFoundError(f"Run {run!r} has no policy yet: train it first.")
        data = self._folder.read_policy()
        try:
            snapshot = PolicySnapshot.from_bytes(data)
        except WireError as error:
            raise RunFolderError(f"{path.name} of run {run!r} is damaged ({error}).") from None
        return PublishedPolicy(snapshot.version, snapshot.sha256, data)

    def curve(self, run: str, since: int = 0) -> Sequence[RoundMetrics]:
        """Return the rows of `metrics.csv` from round `since` on."""
        self._require(run)
        return [row for row in self._folder.read_metrics() if row.round >= since]

    def latest(self, run: str) -> RoundMetrics | None:
        """Return the last row of `metrics.csv`."""
        rows = self.curve(run)
        return rows[-1] if rows else None

    def last_event(self, run: str) -> str:
        """Return the place of the last round."""
        latest = self.latest(run)
        return FIRST_EVENT if latest is None else f"{latest.policy_version}-0"

    def events(self, run: str, after: str) -> Sequence[tuple[str, RoundMetrics]]:
        """Return the rounds after a place."""
        version = int(after.partition("-")[0])
        rows = self.curve(run, since=version)
        return [(f"{row.policy_version}-0", row) for row in rows if row.policy_version > version]

    def workers(self, run: str) -> Sequence[WorkerInfo]:
        """Return no workers."""
        self._require(run)
        return []

    def worker_target(self, run: str) -> int | None:
        """Return that nobody asked for workers."""
        self._require(run)
        return None

    def set_worker_target(self, run: str, target: int | None) -> None:
        """Refuse: a folder has no workers."""
        raise self._refusal(run)

    def request(self, run: str, request: Request) -> None:
        """Refuse: a folder does nothing."""
        raise self._refusal(run)

    def counters(self, run: str) -> RunCounters:
        """Return what the rounds tell: nothing about workers is kept."""
        return RunCounters.of_rows(self.curve(run))

    def quarantine(self, run: str) -> dict[str, int]:
        """Return no reasons: only their total is kept, in the last row of the curve."""
        self._require(run)
        return {}

    def _refusal(self, run: str) -> ConflictError:
        state = self.status(run).state
        if state == "running":
            return ConflictError(_TRAINING)
        return ConflictError(f"This run is {state}: continue it with `taskschema train --resume`.")

    def _require(self, run: str) -> None:
        if run != self._folder.name:
            raise NotFoundError(str(UnknownNameError("run", run[:100], self.runs())))


def _changed(path: Path) -> str:
    """Return when a file was last written, UTC, ISO 8601; empty if there is none."""
    if not path.exists():
        return ""
    return datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(timespec="seconds")
