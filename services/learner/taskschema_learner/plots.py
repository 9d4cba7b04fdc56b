"""Learning curves as pictures: success and schema over episodes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.errors import RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema_learner.run_folder import RunFolder

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GRID_POINTS = 400
"""Places along the axis of episodes at which several runs are averaged."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's colours, which most colour-blind people tell apart."""
STYLES = ("-", "--", ":")
"""Rows of a schema often rise together: where they lie on each other, all are to be seen."""
TARGET = 0.9
"""Success at which the paper stops training."""


@dataclass(frozen=True)
class Curve:
    """One run's learning curve."""

    label: str
    """What it shares with the runs that it is averaged with: task and policy."""
    episodes: FloatArray
    """[K] episodes after each round."""
    success: FloatArray
    """[K] success over the last 100 episodes."""


def plot_run(folder: RunFolder, path: Path) -> None:
    """Draw one run: success above, the schema's probabilities below.

    Raises:
        RunFolderError: if the run has no rounds yet, or the picture cannot be written.

    """
    rows = _rows(folder)
    names = [f"{item.t}: {item.left}, {item.right}" for item in folder.read_schema().best]
    with_schema = folder.config.policy != "state"  # its pairs come from the network, the logits stay zero
    figure, axes = new_figure(2 if with_schema else 1)
    episodes = [row.episodes for row in rows]
    axes[0].plot(
        episodes,
        [row.success_rate for row in rows],
        ".",
        color=COLOURS[5],
        markersize=3,
        label="each round",
    )
    axes[0].plot(
        episodes, [row.success_last_100 for row in rows], color=COLOURS[0], label="last 100 episodes"
    )
    _success_axis(axes[0], folder.name)
    if with_schema:
        for step, name in enumerate(names):
            probability = [row.schema_probability[step] for row in rows]
            colour, style = COLOURS[step % len(COLOURS)], STYLES[step % len(STYLES)]
            axes[1].plot(episodes, probability, style, color=colour, linewidth=2, label=name)
        axes[1].set_ylabel("probability of the\nmost probable skill pair")
        axes[1].set_ylim(-0.02, 1.02)
        axes[1].legend(title="step: left arm, right arm (at the end)", fontsize="small", loc="best")
    axes[-1].set_xlabel("episodes")
    save_figure(figure, path)


def draw_curve(path: Path) -> Path | None:
    """Draw `curve.png` into the folder of a run that is over, and return its path; None: it has no rounds.

    Raises:
        RunFolderError: if the picture cannot be written.

    """
    folder, picture = RunFolder.open(path), path / "curve.png"
    if not folder.read_metrics():
        return None
    plot_run(folder, picture)
    return picture


def plot_runs(folders: Sequence[RunFolder], path: Path) -> None:
    """Draw several runs in one picture: a line per label, the mean of its runs, and their spread around it.

    A run that is over counts with its last value from there on.

    Raises:
        RunFolderError: if a run has no rounds yet, or the picture cannot be written.

    """
    curves = [_curve(folder) for folder in folders]
    figure, (axis,) = new_figure(1)
    last = max(float(curve.episodes[-1]) for curve in curves)
    for number, label in enumerate(sorted({curve.label for curve in curves})):
        members = [curve for curve in curves if curve.label == label]
        grid, mean, low, high = average(members, last)
        colour = COLOURS[number % len(COLOURS)]
        count = f"{len(members)} runs: mean, lowest and highest" if len(members) > 1 else "1 run"
        axis.plot(grid, mean, color=colour, label=f"{label} ({count})")
        if len(members) > 1:
            axis.fill_between(grid, low, high, color=colour, alpha=0.2, linewidth=0)
    _success_axis(axis, "")
    axis.set_ylabel("success over the last 100 episodes")
    axis.set_xlabel("episodes")
    save_figure(figure, path)


def average(curves: Sequence[Curve], last: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return episodes [G] up to `last`, and mean, lowest and highest success [G] of some curves there."""
    grid = np.linspace(0.0, last, GRID_POINTS)
    values = np.stack(
        [np.interp(grid, np.r_[0.0, curve.episodes], np.r_[0.0, curve.success]) for curve in curves]
    )
    return grid, values.mean(axis=0), values.min(axis=0), values.max(axis=0)


def _curve(folder: RunFolder) -> Curve:
    rows = _rows(folder)
    return Curve(
        label=_label(folder),
        episodes=np.array([row.episodes for row in rows], dtype=np.float64),
        success=np.array([row.success_last_100 for row in rows]),
    )


def _label(folder: RunFolder) -> str:
    """Say what a run has in common with others of its kind: all but the seed."""
    config = folder.config
    label = f"{config.task}, {config.policy}"
    if config.policy == "schema" and config.schema.initial_logits is not None:
        label += ", frozen schema" if config.schema.frozen else ", given schema"
    return label


def _rows(folder: RunFolder) -> list[RoundMetrics]:
    rows = folder.read_metrics()
    if not rows:
        raise RunFolderError(f"The run in {folder.path} has no rounds yet: there is nothing to draw.")
    return rows


def new_figure(rows: int, columns: int = 1) -> "tuple[Figure, list[Axes]]":
    """Return an empty figure and its panels, row by row; it needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8 if columns == 1 else 5.5 * columns, 3.6 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, sharex="col" if columns == 1 else False, squeeze=False).ravel()
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, list(axes)


def _success_axis(axis: "Axes", title: str) -> None:
    axis.axhline(TARGET, color="grey", linewidth=0.8, linestyle="--", label="90 %: training stops")
    axis.set_ylim(-0.02, 1.02)
    axis.set_ylabel("success rate")
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    axis.set_title(title)
    axis.legend(fontsize="small", loc="best")


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a picture.

    Raises:
        RunFolderError: if it cannot be written.

    """
    try:
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise RunFolderError(f"The picture {path} cannot be written: {error.strerror}.") from None
