"""Training one cell, in a process of its own: `taskschema train`, as a person would type it."""

import math
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

import filelock

from taskschema.config import RunConfig
from taskschema.errors import ExperimentError
from taskschema_learner.experiment.cell import Cell

# It ends cleanly with the experiment, even one that is killed: the next start then goes on with its run.
_LAUNCH = """
import ctypes, signal
ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG
from taskschema_learner.cli.main import main
main()
"""


class CellTraining:
    """Runs `taskschema train` for one cell after the other; Ctrl-C and SIGTERM stop it cleanly.

    Args:
        runs: folder of the cells' run folders.
        workers: rollout actors; None: one a core; 0: none, the learner's process simulates.

    """

    def __init__(self, runs: Path, workers: int | None) -> None:
        self._runs = runs
        self._workers = workers
        self._child: subprocess.Popen[bytes] | None = None
        self.stopped = False
        """Whether somebody asked for a stop."""

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the cells' runs for one experiment.

        Raises:
            ExperimentError: if another one holds them, or their folder cannot be made.

        """
        lock = filelock.FileLock(self._runs / "experiment.lock", timeout=0)
        try:
            self._runs.mkdir(parents=True, exist_ok=True)
            lock.acquire()
        except filelock.Timeout:
            raise ExperimentError(f"Another experiment trains in {self._runs}: stop it first.") from None
        except OSError as error:
            raise ExperimentError(f"{self._runs} cannot be made: {error.strerror}.") from None
        try:
            yield
        finally:
            lock.release()

    def run_dir(self, cell: Cell) -> Path:
        """Return where a cell's run is."""
        return self._runs / cell.name

    def arguments(self, cell: Cell, config: RunConfig, budget: int) -> list[str]:
        """Return what comes after `taskschema` on the command line; an interrupted cell goes on."""
        path = self.run_dir(cell)
        rounds = math.ceil(budget / (config.slots * config.episodes_per_slot))
        start = [cell.task, "--policy", cell.policy, "--seed", str(cell.seed)]
        if (path / "config.json").exists():
            start = ["--resume"]
        words = ["train", *start, "--rounds", str(rounds), "--run-dir", str(path), "--api", "none"]
        return words if self._workers is None else [*words, "--workers", str(self._workers)]

    def train(self, arguments: Sequence[str]) -> bool:
        """Train until the cell is over, or until somebody asks for a stop; return whether that went well.

        If not, the training has said why in its own words.
        """
        before = {number: signal.signal(number, self._stop) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            # A process group of its own: one Ctrl-C in the terminal is one request, passed on once.
            self._child = subprocess.Popen([sys.executable, "-c", _LAUNCH, *arguments], process_group=0)
            status = self._child.wait()
        finally:
            self._child = None
            for number, handler in before.items():
                signal.signal(number, handler)
        return status == 0 or self.stopped

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self.stopped = True
        if self._child is not None:
            with suppress(ProcessLookupError):
                self._child.send_signal(signal.SIGTERM)
