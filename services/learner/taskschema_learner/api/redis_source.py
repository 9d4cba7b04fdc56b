"""Runs as the learner publishes them in Redis: they can be read while it is down."""

from collections.abc import Sequence

from taskschema.bus.connection import connect
from taskschema.bus.counters import RunCounters
from taskschema.bus.records import PublishedPolicy, Request, RunRecords
from taskschema.bus.run_status import RunStatus
from taskschema.bus.worker_info import WorkerInfo
from taskschema.config import RunConfig
from taskschema.errors import UnknownNameError
from taskschema.metrics import RoundMetrics
from taskschema_learner.api.problems import ConflictError, NotFoundError

PATIENCE_SECONDS = 0.4
"""A command is tried again for about this long [s]: a client would rather hear 503 than wait."""
ANSWER_SECONDS = 1.0
"""Redis must answer within this time [s]; it usually takes less than a millisecond."""
ENDED = ("finished", "stopped", "failed")


class RedisSource:
    """All runs of one Redis."""

    def __init__(self, records: RunRecords) -> None:
        self._records = records

    @classmethod
    def connect(cls, url: str) -> "RedisSource":
        """Return the source for a Redis URL.

        Raises:
            BusError: if there is no Redis, it refuses, or it is too old.
        """
        client = connect(url, patience=PATIENCE_SECONDS)
        # Nothing here waits for news: a Redis that hangs must not hold every thread of the API.
        client.connection_pool.connection_kwargs["socket_timeout"] = ANSWER_SECONDS
        return cls(RunRecords(client))

    def ping(self) -> None:
        """Return if Redis answers.

        Raises:
            BusError: if it does not.
        """
        self._records.ping()

    def runs(self) -> list[str]:
        """Return the names of all runs, sorted."""
        return self._records.runs()

    def config(self, run: str) -> RunConfig:
        """Return a run's configuration."""
        return self._of(run).config(run)

    def status(self, run: str) -> RunStatus:
        """Return what the learner said it is doing."""
        return self._of(run).status(run)

    def schema(self, run: str, version: int | None = None) -> bytes:
        """Return the newest schema, or one of the versions that are kept."""
        data = self._of(run).schema(run, version)
        if data is None:
            raise NotFoundError(self._no_schema(run, version))
        return data

    def _no_schema(self, run: str, version: int | None) -> str:
        versions = self._records.schema_versions(run)
        if version is None or not versions:
            return f"Run {run!r} has no schema yet: ask again when its first policy is published."
        return f"Run {run!r} keeps no schema version {version}. Valid: {_ranges(versions)}."

    def policy(self, run: str) -> PublishedPolicy:
        """Return the newest policy."""
        published = self._of(run).policy(run)
        if published is None:
            raise NotFoundError(f"Run {run!r} has no policy yet: ask again when its first one is published.")
        return published

    def curve(self, run: str, since: int = 0) -> Sequence[RoundMetrics]:
        """Return the rows of all rounds from `since` on."""
        return self._of(run).curve(run, since)

    def latest(self, run: str) -> RoundMetrics | None:
        """Return the newest row."""
        return self._of(run).latest(run)

    def last_event(self, run: str) -> str:
        """Return the place of the newest row in the run's stream."""
        return self._of(run).last_event(run)

    def events(self, run: str, after: str) -> Sequence[tuple[str, RoundMetrics]]:
        """Return the rows published after a place."""
        return self._of(run).events(run, after)

    def workers(self, run: str) -> Sequence[WorkerInfo]:
        """Return the workers that gave a sign of life in the last seconds."""
        return self._of(run).workers(run)

    def worker_target(self, run: str) -> int | None:
        """Return how many workers somebody asked for."""
        return self._of(run).worker_target(run)

    def set_worker_target(self, run: str, target: int | None) -> None:
        """Ask the run's worker pool for a number of workers."""
        self._refuse_if_ended(run)
        self._records.set_worker_target(run, target)

    def request(self, run: str, request: Request) -> None:
        """Leave a request for the learner, which looks several times a second."""
        self._refuse_if_ended(run)
        self._records.request(run, request)

    def counters(self, run: str) -> RunCounters:
        """Return what agents and learners counted."""
        return self._of(run).counters(run)

    def quarantine(self, run: str) -> dict[str, int]:
        """Return how many messages were refused, by kind of reason."""
        return self._of(run).quarantine_counts(run)

    def _refuse_if_ended(self, run: str) -> None:
        state = self.status(run).state
        if state in ENDED:
            raise ConflictError(
                f"Run {run!r} is {state}: continue it with `taskschema train --resume` first."
            )

    def _of(self, run: str) -> RunRecords:
        """Return the records if they know the run."""
        runs = self._records.runs()
        if run not in runs:
            raise NotFoundError(str(UnknownNameError("run", run[:100], runs)))
        return self._records


def _ranges(versions: Sequence[int]) -> str:
    """Return ascending versions in words: `0 to 4, 7`."""
    groups: list[list[int]] = []
    for version in versions:
        if groups and groups[-1][1] == version - 1:
            groups[-1][1] = version
        else:
            groups.append([version, version])
    words = [str(first) if first == last else f"{first} to {last}" for first, last in groups]
    return ", ".join(words[-8:])
