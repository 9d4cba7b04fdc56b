"""`taskschema audit`: whether a task is honest and can be learned."""

from typing import Annotated

import typer

from taskschema_learner.cli.output import Json, print_json


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(audit)


def audit(
    task: Annotated[str, typer.Argument(metavar="TASK", help="Task to audit: see `taskschema tasks`.")],
    seed: Annotated[int, typer.Option(help="Seed of the audit's searches and samples.")] = 0,
    as_json: Json = False,
) -> None:
    """Measure whether a task is honest: what solves it, what must not, and how hard a first success is."""
    from taskschema.tasks.registry import get_task

    audited = get_task(task)
    from taskschema_worker.audit import audit as measure

    report = measure(audited, seed=seed)
    if as_json:
        print_json(report)
    else:
        print(report)
