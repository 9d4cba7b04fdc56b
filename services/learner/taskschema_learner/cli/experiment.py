"""`taskschema experiment`: the paper's experiments, resumable at any time."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

if TYPE_CHECKING:
    from taskschema_learner.experiment.cell import CellResult


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(experiment)


def experiment(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="paper-sim: the paper's learning curves in simulation; images-sim: those from images.",
        ),
    ],
    tasks: Annotated[
        str | None,
        typer.Option(metavar="TASK,...", help="Tasks. Default: the paper's four."),
    ] = None,
    policies: Annotated[
        str | None,
        typer.Option(
            metavar="POLICY,...",
            help="What to compare. Default: schema,state,oracle; of images-sim, transferred,re-learned.",
        ),
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(min=1, help="Seeds 0 to N - 1 of every task and policy. Default: 5."),
    ] = None,
    schemas: Annotated[
        Path | None,
        typer.Option(
            help="Of images-sim: folder of TASK.json, the schemas learned from states. "
            "Default: schemas in the folder of the results."
        ),
    ] = None,
    budget: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Episodes of a cell, other than of state. Default: 200,000; of images-sim, 40,000, and of "
            "re-learned what learning should take, where that is known.",
        ),
    ] = None,
    baseline_budget: Annotated[
        int,
        typer.Option(
            min=0,
            help="Least episodes of a cell of state. Its own budget is five times the median of schema on "
            "lateral lifting, and the slowest seed of schema on every other task.",
        ),
    ] = 0,
    workers: Annotated[
        int | None,
        typer.Option(min=0, help="Rollout workers. Default: the cores. 0: in the learner's process."),
    ] = None,
    verify: Annotated[
        bool,
        typer.Option(
            "--verify",
            help="Train finished cells again instead, and compare their policies' hashes; the page says what "
            "came out. The exit status is 1 if one differs.",
        ),
    ] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder of the results. Default: results/NAME.")
    ] = None,
    runs_dir: Annotated[Path | None, typer.Option(help="Folder of the runs. Default: runs/NAME.")] = None,
) -> None:
    """Train a matrix of tasks, policies and seeds, and write its tables and its figure.

    Ctrl-C stops it at any time; the same command goes on where it stopped, and skips what is finished.
    """
    from taskschema.errors import UnknownNameError
    from taskschema.tasks.registry import get_task
    from taskschema_learner.experiment.cell import IMAGE_POLICIES, CellPolicy
    from taskschema_learner.experiment.plan import WHOLE

    if name not in WHOLE:
        raise UnknownNameError("experiment", name, WHOLE)
    plan = WHOLE[name]
    valid = [kind for kind in get_args(CellPolicy) if (kind in IMAGE_POLICIES) == (name == "images-sim")]
    words = _words(policies) if policies else plan.policies
    for word in words:
        if word not in valid:
            raise UnknownNameError("policy", word, valid)
    task_list = _words(tasks) if tasks else plan.tasks
    for task in task_list:
        get_task(task)
    plan = replace(
        plan,
        tasks=task_list,
        policies=[kind for kind in valid if kind in words],
        seeds=seeds or plan.seeds,
        baseline_budget=baseline_budget,
    )
    if budget is not None:
        plan = replace(plan, budget=budget, relearning_budgets={})

    from taskschema_learner.experiment.experiment import run_experiment
    from taskschema_learner.experiment.recipe import ImagesSim, PaperSim
    from taskschema_learner.experiment.verification import verify_cells

    output = output or Path("results") / name
    recipe = ImagesSim(schemas or output / "schemas") if name == "images-sim" else PaperSim()
    command = shlex.join(["taskschema", *sys.argv[1:]])
    runs = runs_dir or Path("runs") / name
    if verify:
        _verify(verify_cells(name, plan, recipe, output, runs, workers))
        return
    if run_experiment(name, plan, recipe, output, runs, workers, command):
        print(f"All cells are done: {output / 'README.md'}")
    else:
        print(f"Stopped. Continue with: {command}")


def _verify(trained: "Sequence[CellResult]") -> None:
    """Say what became of cells that were trained again.

    Raises:
        typer.Exit: if one has another policy than before.

    """
    different = [item.cell.name for item in trained if item.verification and not item.verification.same]
    print(f"{len(trained) - len(different)} of {len(trained)} cells end with the same policy as before.")
    if different:
        print(f"Different: {', '.join(different)}.")
        raise typer.Exit(1)


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]
