"""A picture of where an object is wanted, from above, as the overhead camera sees the table."""

from pathlib import Path

import numpy as np

from taskschema.arrays import FloatArray
from taskschema_robot.objects.marker import table_markers
from taskschema_robot.objects.robot_object import RobotObject

HALF_VIEW = 0.55
"""Of the table that the picture shows [m]."""


def draw_reset(path: Path, item: RobotObject, wanted: FloatArray) -> None:
    """Write a PNG of an object's outline and markers at its wanted pose [7 + h] on the table."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    yaw = 2.0 * np.arctan2(wanted[6], wanted[3])
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    figure = Figure(figsize=(6, 6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(aspect="equal", title=f"{item.name}: wanted start, from above")
    axes.set_xlim(-HALF_VIEW, HALF_VIEW)
    axes.set_ylim(-HALF_VIEW, HALF_VIEW)
    axes.set_xlabel("x [m]; left robot below, right robot above")
    axes.set_ylabel("y [m]")
    axes.grid(alpha=0.3)
    for marker in table_markers():
        _square(axes, marker.corners[:, :2], str(marker.number), "tab:gray")
    half = 0.5 * np.array(item.size[:2])
    outline = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half @ turn.T + wanted[:2]
    axes.fill(*outline.T, color="tab:blue", alpha=0.4)
    for marker in (*item.markers, *item.joint_markers):
        _square(axes, marker.corners[:, :2] @ turn.T + wanted[:2], str(marker.number), "black")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)


def _square(axes, corners: FloatArray, label: str, colour: str) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
    axes.fill(*corners.T, fill=False, color=colour)
    axes.text(*corners.mean(axis=0), label, ha="center", va="center", fontsize=7, color=colour)
