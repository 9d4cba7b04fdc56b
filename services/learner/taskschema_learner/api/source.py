"""What the API needs to know about runs, wherever they are kept."""

from collections.abc import Sequence
from typing import Protocol

from taskschema.bus.counters import RunCounters
from taskschema.bus.records import PublishedPolicy, Request
from taskschema.bus.run_status import RunStatus
from taskschema.bus.worker_info import WorkerInfo
from taskschema.config import RunConfig
from taskschema.metrics import RoundMetrics


class RunSource(Protocol):
    """Runs and what is known about them.

    Methods block; every method that takes a run raises NotFoundError for an unknown one, and all raise
    BusError or RunFolderError when what keeps the runs cannot be read.
    """

    def ping(self) -> None:
        """Return if the source can answer."""

    def runs(self) -> list[str]:
        """Return the names of all runs."""

    def config(self, run: str) -> RunConfig:
        """Return a run's configuration."""

    def status(self, run: str) -> RunStatus:
        """Return what a run is doing."""

    def schema(self, run: str, version: int | None = None) -> bytes:
        """Return the schema document as JSON: the newest, or of one policy version.

        Raises:
            NotFoundError: if there is none; the message names the versions that there are.
        """

    def policy(self, run: str) -> PublishedPolicy:
        """Return the newest policy.

        Raises:
            NotFoundError: if there is none yet.
        """

    def curve(self, run: str, since: int = 0) -> Sequence[RoundMetrics]:
        """Return the rows of all rounds from `since` on, oldest first."""

    def latest(self, run: str) -> RoundMetrics | None:
        """Return the row of the newest round, if there is one."""

    def last_event(self, run: str) -> str:
        """Return the place of the newest event, `FIRST_EVENT` if there is none."""

    def events(self, run: str, after: str) -> Sequence[tuple[str, RoundMetrics]]:
        """Return (place, row) of the rounds published after a place; does not wait.

        A place is `NUMBER-NUMBER`, `FIRST_EVENT` the one before every round.
        """

    def workers(self, run: str) -> Sequence[WorkerInfo]:
        """Return the workers that are alive."""

    def worker_target(self, run: str) -> int | None:
        """Return how many workers somebody asked for, if somebody did."""

    def set_worker_target(self, run: str, target: int | None) -> None:
        """Ask for a number of workers; None: as many as there is capacity for.

        Raises:
            ConflictError: if the run is finished.
        """

    def request(self, run: str, request: Request) -> None:
        """Ask a run to pause, resume or stop.

        Raises:
            ConflictError: if the run is in no state to do so.
        """

    def counters(self, run: str) -> RunCounters:
        """Return what was counted about a run since it began."""

    def quarantine(self, run: str) -> dict[str, int]:
        """Return how many messages were refused so far, by reason."""
