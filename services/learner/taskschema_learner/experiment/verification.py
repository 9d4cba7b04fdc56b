"""Training finished cells again: does today's code end with the same policy, to the bit?"""

from pathlib import Path

import msgspec

from taskschema.errors import ExperimentError
from taskschema_learner.experiment.cell import CellResult, Verification
from taskschema_learner.experiment.cell_training import CellTraining
from taskschema_learner.experiment.experiment import publish
from taskschema_learner.experiment.measurement import source_commit
from taskschema_learner.experiment.plan import Plan
from taskschema_learner.experiment.recipe import Recipe
from taskschema_learner.experiment.results_folder import ResultsFolder
from taskschema_learner.machine import today
from taskschema_learner.runs.run_folder import RunFolder


def verify_cells(
    name: str, plan: Plan, recipe: Recipe, out: Path, runs: Path, workers: int | None
) -> list[CellResult]:
    """Train the plan's finished cells again, write down what came out, and return those that were trained.

    Their runs lie beside the experiment's own and stay there: one that was stopped goes on.

    Raises:
        ExperimentError: if no cell of the plan is finished, or a training failed.

    """
    folder, training = ResultsFolder(out), CellTraining(runs / "again", workers)
    cells = plan.cells()
    finished = [result for result in folder.read_for(name).cells if result.cell in cells and result.is_over]
    if not finished:
        raise ExperimentError(f"{out} has no finished cell of these: train them first, without --verify.")
    verified = []
    with training.locked():
        for result in sorted(finished, key=lambda item: cells.index(item.cell)):
            print(f"{result.cell.name}: {result.episodes:,} episodes again", flush=True)
            verified_result = _again(result, recipe, training)
            if verified_result is None:
                break
            verified.append(verified_result)
            _write_down(folder, name, verified_result)
    return verified


def _again(result: CellResult, recipe: Recipe, training: CellTraining) -> CellResult | None:
    """Return a cell with what became of it now; None: somebody asked for a stop."""
    cell = result.cell
    options, config = recipe.options(cell), recipe.config(cell)
    if not training.train(training.arguments(cell, config, options, result.episodes)):
        raise ExperimentError(
            f"The training of {cell.name} failed: mend what it says above, then start again."
        )
    rows = RunFolder.open(training.run_dir(cell)).read_metrics()
    if training.stopped:
        return None
    verification = Verification(day=today(), commit=source_commit(), same=rows[-1].sha256 == result.sha256)
    return msgspec.structs.replace(result, verification=verification)


def _write_down(folder: ResultsFolder, name: str, verified: CellResult) -> None:
    summary = folder.read_for(name)
    cells = tuple(verified if known.cell == verified.cell else known for known in summary.cells)
    publish(folder, msgspec.structs.replace(summary, cells=cells))
