"""`taskschema experiment`: the paper's experiments, resumable at any time."""

import shlex
import sys
from pathlib import Path
from typing import Annotated, get_args

import typer

EXPERIMENTS = ("paper-sim",)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(experiment)


def experiment(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="paper-sim: the paper's learning curves in simulation.")
    ],
    tasks: Annotated[
        str | None, typer.Option(metavar="TASK,...", help="Tasks. Default: the paper's four.")
    ] = None,
    policies: Annotated[
        str, typer.Option(metavar="POLICY,...", help="Policies to compare.")
    ] = "schema,state,oracle",
    seeds: Annotated[int, typer.Option(min=1, help="Seeds 0 to N - 1 of every task and policy.")] = 5,
    budget: Annotated[
        int, typer.Option(min=1, help="Episodes that a cell of schema or oracle may take.")
    ] = 200_000,
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
    out: Annotated[Path | None, typer.Option(help="Folder of the results. Default: results/NAME.")] = None,
    runs_dir: Annotated[Path | None, typer.Option(help="Folder of the runs. Default: runs/NAME.")] = None,
) -> None:
    """Train a matrix of tasks, policies and seeds, and write its tables and its figure.

    Ctrl-C stops it at any time; the same command goes on where it stopped, and skips what is finished.
    """
    from taskschema.config import PolicyKind
    from taskschema.errors import UnknownNameError
    from taskschema.tasks.registry import get_task
    from taskschema_learner.experiment.plan import PAPER_TASKS, Plan

    if name not in EXPERIMENTS:
        raise UnknownNameError("experiment", name, EXPERIMENTS)
    kinds = [kind for kind in get_args(PolicyKind) if kind in _words(policies)]
    for word in _words(policies):
        if word not in kinds:
            raise UnknownNameError("policy", word, get_args(PolicyKind))
    task_list = list(PAPER_TASKS) if tasks is None else _words(tasks)
    for task in task_list:
        get_task(task)

    from taskschema_learner.experiment.experiment import paper_sim

    plan = Plan(task_list, kinds, seeds, budget, baseline_budget)
    command = shlex.join(["taskschema", *sys.argv[1:]])
    out = out or Path("results") / name
    if paper_sim(plan, out, runs_dir or Path("runs") / name, workers, command):
        print(f"All cells are done: {out / 'README.md'}")
    else:
        print(f"Stopped. Continue with: {command}")


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]
