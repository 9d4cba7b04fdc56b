"""The paper's figure: success rate against episodes, mean and spread over seeds, one panel a task."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from taskschema.errors import ExperimentError
from taskschema_learner.experiment.cell import CellResult
from taskschema_learner.experiment.plan import PAPER_TASKS
from taskschema_learner.experiment.results_folder import ResultsFolder, Summary
from taskschema_learner.views.plots import TARGET, Curve, average, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"schema": "#e69f00", "state": "#0072b2", "oracle": "#009e73"} | {
    "transferred": "#e69f00",
    "re-learned": "#0072b2",
}
"""Orange, blue and green, as in the paper; Okabe and Ito's shades."""
COLUMNS = 2
KEY = "line: mean over so many seeds; band: lowest to highest; thin: all are solved; dotted: not over yet"
FIGURE = "figure.png"
"""Where the figure stands among the results."""


def draw_figure(folder: ResultsFolder, summary: Summary, path: Path) -> None:
    """Draw the curves of all cells.

    A solved run counts with its last value from there on; where all are, the line goes on thin. Cells that
    are not over are thin dotted lines.

    Raises:
        ExperimentError: if there is no cell yet, or a curve is damaged.
        RunFolderError: if the picture cannot be written.

    """
    names = dict.fromkeys(result.task for result in summary.cells)
    tasks = [name for name in PAPER_TASKS if name in names]
    tasks += [name for name in names if name not in tasks]
    if not tasks:
        raise ExperimentError(f"{folder.path} has no cell yet: there is nothing to draw.")
    columns = min(COLUMNS, len(tasks))
    figure, axes = new_figure(math.ceil(len(tasks) / columns), columns)
    for axis, task in zip(axes, tasks, strict=False):
        _panel(axis, folder, [result for result in summary.cells if result.task == task])
        axis.set_title(task.replace("-", " "), loc="left")
    for axis in axes[len(tasks) :]:
        axis.set_visible(False)
    figure.supxlabel(KEY, fontsize="medium")
    save_figure(figure, path)


def _panel(axis: "Axes", folder: ResultsFolder, results: list[CellResult]) -> None:
    longest = max(result.episodes for result in results)
    for policy, colour in COLOURS.items():
        group = [result for result in results if result.policy == policy]
        over = [result for result in group if result.is_over]
        if over:
            mean = _mean_line(axis, [_curve(folder, result) for result in over], policy, colour)
            if all(result.state == "solved" for result in over):
                last = max(result.episodes for result in over)
                axis.hlines(mean, last, longest, color=colour, linewidth=0.8)
        for number, result in enumerate(item for item in group if not item.is_over):
            curve = _curve(folder, result)
            label = f"{policy} (0)" if number == 0 and not over else None
            axis.plot(curve.episodes, curve.success, ":", color=colour, linewidth=1, label=label)
    axis.axhline(TARGET, color="grey", linewidth=0.8, linestyle="--")
    axis.set_ylim(-0.02, 1.02)
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    axis.xaxis.set_major_formatter(lambda value, _: f"{value / 1000:g}k")
    axis.set_ylabel("success rate")
    axis.set_xlabel("episodes")
    # Above the panel: inside it, some curve or other is always in the way.
    axis.legend(
        loc="lower right",
        bbox_to_anchor=(1.01, 0.99),
        ncols=3,
        frameon=False,
        handlelength=1.2,
        columnspacing=1.0,
        borderaxespad=0.2,
    )


def _mean_line(axis: "Axes", curves: list[Curve], policy: str, colour: str) -> float:
    """Draw the mean and the band of some seeds; return where the mean ends."""
    grid, mean, low, high = average(curves, max(float(curve.episodes[-1]) for curve in curves))
    axis.plot(grid, mean, color=colour, linewidth=2, label=f"{policy} ({len(curves)})")
    axis.fill_between(grid, low, high, color=colour, alpha=0.2, linewidth=0)
    return float(mean[-1])


def _curve(folder: ResultsFolder, result: CellResult) -> Curve:
    episodes, success = np.array(folder.read_curve(result.cell), dtype=np.float64).T
    return Curve(result.policy, episodes, success)
