"""The folder that an experiment's results are committed from: one small table a cell, and a summary."""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from taskschema.config import RunConfig
from taskschema.errors import ExperimentError
from taskschema_learner.experiment.cell import Cell, CellResult
from taskschema_learner.runs.run_folder import write_atomically

SUMMARY = "summary.json"
REMARKS = "remarks.md"
"""What a person adds to the page: reasons that the figures do not give by themselves."""
HEADER = ("episodes", "success_last_100")


class Summary(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything that is known about an experiment but the curves."""

    experiment: str
    commands: tuple[str, ...] = ()
    """What was typed, each different command once."""
    machines: tuple[str, ...] = ()
    """Cores and kind of what it ran on."""
    versions: dict[str, str] = {}
    """Of this project and of what computes its results."""
    settings: RunConfig | None = None
    """What all cells share; its `task`, `policy`, `seed` and `episodes_per_slot` stand for any."""
    cells: tuple[CellResult, ...] = ()


class ResultsFolder:
    """Reads and writes one experiment's results; every file is replaced as a whole."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @staticmethod
    def is_one(path: Path) -> bool:
        """Whether a folder holds an experiment's results."""
        return (path / SUMMARY).is_file()

    def make(self) -> None:
        """Make the folder, if it is not there.

        Raises:
            ExperimentError: if that cannot be.

        """
        try:
            (self.path / "cells").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ExperimentError(f"{self.path} cannot be made: {error.strerror}.") from None

    def read(self) -> Summary:
        """Return the summary.

        Raises:
            ExperimentError: if there is none, or it is damaged.

        """
        path = self.path / SUMMARY
        try:
            return msgspec.json.decode(path.read_bytes(), type=Summary)
        except (OSError, msgspec.MsgspecError) as error:
            raise ExperimentError(
                f"{path} cannot be read ({error}): restore it, or move it away to start anew."
            ) from None

    def read_for(self, experiment: str) -> Summary:
        """Return the summary of this experiment, an empty one if there is none yet.

        Raises:
            ExperimentError: if it is damaged, or another experiment's.

        """
        if not self.is_one(self.path):
            return Summary(experiment=experiment)
        summary = self.read()
        if summary.experiment != experiment:
            raise ExperimentError(
                f"{self.path} holds the results of {summary.experiment}: choose another --output."
            )
        return summary

    def remarks(self) -> str:
        """Return what a person added to the page; nothing if nobody did.

        Raises:
            ExperimentError: if it cannot be read.

        """
        path = self.path / REMARKS
        try:
            return path.read_text(encoding="utf-8") if path.exists() else ""
        except (OSError, ValueError) as error:
            raise ExperimentError(f"{path} cannot be read: {error}.") from None

    def write(self, summary: Summary) -> None:
        """Replace the summary."""
        data = msgspec.json.format(msgspec.json.encode(summary), indent=1)
        write_atomically(self.path / SUMMARY, data + b"\n")

    def write_curve(self, cell: Cell, curve: Iterable[tuple[int, float]]) -> None:
        """Replace a cell's table."""
        buffer = io.StringIO(newline="")
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(HEADER)
        writer.writerows(curve)
        write_atomically(self._curve_path(cell), buffer.getvalue().encode())

    def read_curve(self, cell: Cell) -> Sequence[tuple[int, float]]:
        """Return a cell's table: episodes and success over the last 100, oldest first.

        Raises:
            ExperimentError: if it is missing or damaged.

        """
        path = self._curve_path(cell)
        try:
            with path.open(newline="", encoding="utf-8") as file:
                return [(int(row[HEADER[0]]), float(row[HEADER[1]])) for row in csv.DictReader(file)]
        except (OSError, ValueError, KeyError, csv.Error) as error:
            raise ExperimentError(f"{path} cannot be read ({error}): restore it.") from None

    def _curve_path(self, cell: Cell) -> Path:
        return self.path / "cells" / f"{cell.name}.csv"
