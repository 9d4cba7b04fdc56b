"""`taskschema plot`: learning curves as pictures."""

from pathlib import Path
from typing import Annotated

import typer

from taskschema_learner.cli.run_reference import find_run


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(plot)


def plot(
    runs: Annotated[list[str], typer.Argument(metavar="RUN...", help="Folders of runs, or their names.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File of the picture (.png, .svg or .pdf).")
    ] = None,
) -> None:
    """Draw learning curves: one run with its schema, or several with mean and spread for each kind.

    Runs that differ only in their seed are of one kind. One run's picture goes to curve.png in its
    folder, that of several to curves.png here, unless --output says otherwise.
    """
    from taskschema_learner.plots import plot_run, plot_runs

    folders = [find_run(run) for run in runs]
    if len(folders) == 1:
        path = output or folders[0].path / "curve.png"
        plot_run(folders[0], path)
    else:
        path = output or Path("curves.png")
        plot_runs(folders, path)
    print(path)
