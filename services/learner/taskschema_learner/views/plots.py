"""Learning curves as pictures: success and schema over episodes."""

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from taskschema.arrays import FloatArray
from taskschema.config import RunConfig
from taskschema.errors import RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema_learner.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GRID_POINTS = 400
"""Places along the axis of episodes at which several runs are averaged."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's colours, which most colour-blind people tell apart."""
STYLES = ("-", "--", ":")
"""Rows of a schema often rise together: where they lie on each other, all are to be seen."""
LONGEST_VALUE = 20
"""Characters of a setting in a label; what is longer is named by its hash."""
TARGET = 0.9
"""Success at which the paper stops training."""


@dataclass(frozen=True)
class Curve:
    """One run's learning curve."""

    label: str
    """What it shares with the runs that it is averaged with."""
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

    Runs of one label differ in nothing but their seeds. A run that is over counts with its last value from
    there on.

    Raises:
        RunFolderError: if a run has no rounds yet, or the picture cannot be written.

    """
    labels = labels_of([folder.config for folder in folders])
    curves = [_curve(folder, label) for folder, label in zip(folders, labels, strict=True)]
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


def _curve(folder: RunFolder, label: str) -> Curve:
    rows = _rows(folder)
    return Curve(
        label=label,
        episodes=np.array([row.episodes for row in rows], dtype=np.float64),
        success=np.array([row.success_last_100 for row in rows]),
    )


def labels_of(configs: Sequence[RunConfig]) -> list[str]:
    """Return what to call each run: one label for those that differ in nothing but their seeds.

    It is the task and the policy; where several kinds share these, the settings in which they differ follow.
    """
    kinds = {_kind(config): config for config in configs}
    settings = {kind: _settings(msgspec.to_builtins(config)) for kind, config in kinds.items()}

    def label(config: RunConfig) -> str:
        own = settings[_kind(config)]
        namesakes = [settings[kind] for kind, other in kinds.items() if _name(other) == _name(config)]
        differing = [field for field in own if len({other[field] for other in namesakes}) > 1]
        return ", ".join([_name(config), *(f"{field} {own[field]}" for field in differing)])

    return [label(config) for config in configs]


def _kind(config: RunConfig) -> str:
    """Return the hash of all that a run has in common with others of its kind: all but the seed."""
    return msgspec.structs.replace(config, seed=0).config_hash


def _name(config: RunConfig) -> str:
    name = f"{config.task}, {config.policy}"
    if config.policy == "schema" and config.schema.initial_logits is not None:
        name += ", frozen schema" if config.schema.frozen else ", given schema"
    return name


def _settings(data: dict[str, Any], prefix: str = "") -> dict[str, str]:
    """Return every setting but the seed by its dotted name, in words short enough for a label."""
    found: dict[str, str] = {}
    for key, value in data.items():
        if isinstance(value, dict):
            found |= _settings(value, f"{prefix}{key}.")
        elif prefix + key != "seed":
            found[prefix + key] = _words(value)
    return found


def _words(value: Any) -> str:  # noqa: ANN401 - whatever a config holds
    if value is None:
        return "none"
    text = value if isinstance(value, str) else msgspec.json.encode(value).decode()
    if len(text) <= LONGEST_VALUE:
        return text
    is_hash = re.fullmatch("[0-9a-f]{64}", text)
    return (text if is_hash else hashlib.sha256(text.encode()).hexdigest())[:8]


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
