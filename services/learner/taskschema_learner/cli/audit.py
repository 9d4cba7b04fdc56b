"""`taskschema audit`: whether a task is honest and can be learned."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Also write the table there, as Markdown."),
    ] = None,
    good_schemas: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also write the good set there, which results are compared with."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure whether a task is honest: what solves it, what must not, and how hard a first success is.

    The exit status is 1 if a demand is not met. With --output, what is counted is kept in FILE.parts until
    the audit is done: Ctrl-C stops it, and the same command goes on.
    """
    from taskschema_learner.cli.task_reference import named_task, task_and_source

    audited = named_task(task, task_file)
    from taskschema_learner.runs.run_folder import write_atomically
    from taskschema_worker.audit import About, Journal, code_sha256
    from taskschema_worker.audit import audit as measure

    journal = Journal()
    if output is not None:
        _, source = task_and_source(task, task_file)
        about = About(audited.name, source, effort, seed, code_sha256())
        journal = Journal(output.with_name(f"{output.name}.parts"), about)
        if len(journal):
            print(f"Going on after {len(journal)} parts.", file=sys.stderr)
    with _progress() as progress:
        report = measure(
            audited,
            seed=seed,
            effort=effort,
            progress=progress,
            threads=os.cpu_count() or 1,
            journal=journal,
        )
    if output is not None:
        write_atomically(output, report.to_markdown().encode())
    if good_schemas is not None:
        write_atomically(good_schemas, report.good_schemas_json.encode())
    journal.remove()
    print(report.to_json() if as_json else report.to_markdown(), end="")
    if not all(report.verdicts.values()):
        raise typer.Exit(1)


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """Show how far the audit is: live in a terminal, elsewhere a line as each kind of part begins."""
    from rich.console import Console

    console, begun = Console(stderr=True), set[str]()

    def say(part: str, share: float) -> None:
        if part not in begun:
            begun.add(part)
            print(f"Auditing: {part}", file=sys.stderr, flush=True)

    if not console.is_terminal:
        yield say
        return
    with console.status("Auditing") as status:
        yield lambda part, share: status.update(f"Auditing: {part}, {share:.0%}")
