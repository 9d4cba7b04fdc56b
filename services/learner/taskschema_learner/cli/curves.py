"""`taskschema plot`: learning curves as pictures."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskschema_learner.cli.run_reference import find_run

if TYPE_CHECKING:
    from taskschema_learner.experiment.results_folder import ResultsFolder
    from taskschema_learner.runs.run_folder import RunFolder


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(plot)


def plot(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN...", help="Folders of runs, or their names; or an experiment's folder of results."
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File of the picture (.png, .svg or .pdf).")
    ] = None,
    response_maps: Annotated[
        bool,
        typer.Option(
            "--response-maps", help="Of a run on images: where on the table each arm goes, over the frames."
        ),
    ] = False,
) -> None:
    """Draw learning curves: one run with its schema, or several with mean and spread for each kind.

    Runs that differ only in their seed are of one kind. One run's picture goes to curve.png in its
    folder, that of several to curves.png here, unless --output says otherwise. Of an experiment's results,
    such as results/paper-sim, it draws the paper's figure: a panel a task, mean and spread of each policy.
    """
    from taskschema_learner.experiment.results_folder import ResultsFolder
    from taskschema_learner.views.plots import plot_run, plot_runs

    if len(runs) == 1 and ResultsFolder.is_one(Path(runs[0])):
        print(_plot_experiment(ResultsFolder(Path(runs[0])), output))
        return
    folders = [find_run(run) for run in runs]
    if response_maps:
        print(_plot_response_maps(folders, output))
        return
    if len(folders) == 1:
        path = output or folders[0].path / "curve.png"
        plot_run(folders[0], path)
    else:
        path = output or Path("curves.png")
        plot_runs(folders, path)
    print(path)


def _plot_response_maps(folders: "list[RunFolder]", output: Path | None) -> Path:
    from taskschema.errors import ConfigError
    from taskschema_learner.views.response_maps import plot_response_maps

    if len(folders) != 1:
        raise ConfigError("--response-maps draws one run: name one RUN.")
    path = output or folders[0].path / "response_maps.png"
    plot_response_maps(folders[0], path)
    return path


def _plot_experiment(folder: "ResultsFolder", output: Path | None) -> Path:
    from taskschema_learner.experiment.figure import FIGURE, draw_figure

    path = output or folder.path / FIGURE
    draw_figure(folder, folder.read(), path)
    return path
