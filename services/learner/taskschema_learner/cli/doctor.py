"""`taskschema doctor`: what works on this machine."""

from typing import Annotated

import typer

from taskschema_learner.cli.output import Json, print_json


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(doctor)


def doctor(
    full: Annotated[
        bool, typer.Option("--full", help="Also start a local Ray, which takes seconds.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Look at this machine: what works, and what to do about what does not.

    The exit status is 1 if something is missing that training needs.
    """
    from taskschema_learner.doctor import examine

    checks = examine(full=full)
    if as_json:
        print_json(checks)
    else:
        from rich.console import Console
        from rich.table import Table

        colours = {"works": "green", "optional": "yellow", "missing": "red"}
        table = Table("what", "status", "found", "what to do", show_lines=True)
        for check in checks:
            status = f"[{colours[check.status]}]{check.status}[/]"
            table.add_row(check.name, status, check.finding, check.advice)
        Console().print(table)
    if any(check.status == "missing" for check in checks):
        raise typer.Exit(1)
