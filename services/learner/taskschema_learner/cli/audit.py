"""`taskschema audit`: whether a task is honest and can be learned."""

import os
from pathlib import Path
from typing import Annotated

import typer

from taskschema_learner.cli.output import Json


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(audit)


def audit(
    task: Annotated[
        str | None, typer.Argument(metavar="TASK", help="Task to audit: see `taskschema tasks`.")
    ] = None,
    task_file: Annotated[
        str | None, typer.Option(metavar="FILE:CLASS", help="A task of your own instead of TASK.")
    ] = None,
    effort: Annotated[
        str, typer.Option(metavar="quick|medium|full", help="Sample sizes: minutes, half an hour, or hours.")
    ] = "quick",
    seed: Annotated[int, typer.Option(help="Seed of the audit's searches and samples.")] = 0,
    output: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also write the table there, as Markdown.")
    ] = None,
    good_schemas: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also write the good set there, which results are compared with."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure whether a task is honest: what solves it, what must not, and how hard a first success is.

    The exit status is 1 if a demand is not met.
    """
    from rich.console import Console

    from taskschema_learner.cli.task_reference import named_task

    audited = named_task(task, task_file)
    from taskschema_learner.run_folder import write_atomically
    from taskschema_worker.audit import audit as measure

    with Console(stderr=True).status("Auditing") as status:
        report = measure(
            audited,
            seed=seed,
            effort=effort,
            progress=lambda part, share: status.update(f"Auditing: {part}, {share:.0%}"),
            threads=os.cpu_count() or 1,
        )
    if output is not None:
        write_atomically(output, report.to_markdown().encode())
    if good_schemas is not None:
        write_atomically(good_schemas, report.good_schemas_json.encode())
    print(report.to_json() if as_json else report.to_markdown(), end="")
    if not all(report.verdicts.values()):
        raise typer.Exit(1)
