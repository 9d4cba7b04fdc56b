"""Where an object's markers go: a page with views from above and from the side, and their places in mm."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from taskschema.arrays import FloatArray
from taskschema_robot.objects.marker import Marker
from taskschema_robot.objects.robot_object import Part, RobotObject

VIEWS = (
    ("from above: x to the right, y up", 0, 1, (0.14, 0.58, 0.72, 0.33)),
    ("from the left robot: x to the right, z up", 0, 2, (0.14, 0.33, 0.72, 0.19)),
)
"""Title, which axes of the object run to the right and up, and where on the page."""
CIRCLE = np.linspace(0.0, 2.0 * np.pi, 25)
MILLIMETRES = 1000.0
AXES = ("x", "y", "z")
COLUMNS = ("marker", "size", "x", "y", "z", "its right points to", "its top points to", "on")


def draw_placement(figure: Any, item: RobotObject) -> None:  # noqa: ANN401 - matplotlib is imported to draw
    """Draw the page: the object's frame is at the middle of its bounding box."""
    size = MILLIMETRES * np.array(item.size)
    for title, across, up, place in VIEWS:
        axes = figure.add_axes(place, aspect="equal", title=title)
        axes.set_xlabel(f"{AXES[across]} [mm]")
        axes.set_ylabel(f"{AXES[up]} [mm]")
        axes.grid(alpha=0.3)
        for part in (*item.parts, *item.joint_parts):
            outline = cv2.convexHull((MILLIMETRES * _surface(part)[:, [across, up]]).astype(np.float32))[:, 0]
            axes.fill(*outline.T, facecolor=(*part.colour, 0.4), edgecolor="gray", lw=0.5)
        _draw_markers(axes, (*item.markers, *item.joint_markers), across, up)
        _dimension(axes, size, across, up)
    _list(figure, item)


def _draw_markers(axes: Any, markers: Sequence[Marker], across: int, up: int) -> None:  # noqa: ANN401
    """Draw markers with their tops in red; what lies behind one another shares a label."""
    labels: dict[tuple[float, float], list[str]] = {}
    for marker in markers:
        corners = MILLIMETRES * marker.corners[:, [across, up]]
        axes.fill(*corners.T, fill=False, color="black", lw=1.2)
        axes.plot(*corners[:2].T, color="tab:red", lw=2.0)
        x, y = corners.mean(axis=0).round(1).tolist()
        labels.setdefault((x, y), []).append(str(marker.number))
    for place, numbers in labels.items():
        above = (0, 0 if up == 1 else 9)
        axes.annotate(
            ", ".join(numbers), place, above, textcoords="offset points", ha="center", va="center", fontsize=8
        )


def _dimension(axes: Any, size: FloatArray, across: int, up: int) -> None:  # noqa: ANN401
    """Write the bounding box's edges along the view, with arrows."""
    wide, tall = 0.5 * size[across], 0.5 * size[up]
    room = 0.06 * size.max() + 8.0
    arrow = {"arrowstyle": "<->", "color": "tab:blue", "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (-wide, -tall - room), (wide, -tall - room), arrowprops=arrow)
    axes.annotate("", (wide + room, -tall), (wide + room, tall), arrowprops=arrow)
    axes.text(0.0, -tall - 1.3 * room, f"{size[across]:.0f}", ha="center", va="top", color="tab:blue")
    axes.text(wide + 1.3 * room, 0.0, f"{size[up]:.0f}", ha="left", va="center", color="tab:blue")
    axes.set_xlim(-wide - 2.0 * room, wide + 3.5 * room)
    axes.set_ylim(-tall - 3.5 * room, tall + 2.0 * room)


def _list(figure: Any, item: RobotObject) -> None:  # noqa: ANN401
    rows = [_row(marker, "object") for marker in item.markers]
    rows += [_row(marker, "turning part") for marker in item.joint_markers]
    axes = figure.add_axes((0.06, 0.12, 0.88, 0.15))
    axes.axis("off")
    table = axes.table(rows, colLabels=COLUMNS, loc="upper center", cellLoc="center")
    table.auto_set_font_size(False)
    table.set_fontsize(7)
    words = (
        "Millimetres from the middle of the bounding box; x to the right and y away, seen from the left robot"
        ", before it is turned.\nThe red edge is a picture's top. " + " ".join(item.reset)
    )
    figure.text(0.5, 0.105, words, ha="center", va="top", fontsize=6.5, wrap=True)


def _row(marker: Marker, link: str) -> tuple[str, ...]:
    x, y, z = (f"{round(MILLIMETRES * value, 1) + 0.0:+.1f}" for value in marker.position)
    size = f"{MILLIMETRES * marker.size:.0f}"
    return str(marker.number), size, x, y, z, direction(marker.x_axis), direction(marker.y_axis), link


def direction(axis: tuple[float, float, float]) -> str:
    """Return an axis in words: `+x`, or `+x -z` for one halfway between two."""
    parts = [f"{'+' if value > 0.0 else '-'}{name}" for name, value in zip(AXES, axis, strict=True) if value]
    return " ".join(parts)


def _surface(part: Part) -> FloatArray:
    """Return points [P, 3] whose convex hull is a part, in its link's frame [m]."""
    return np.asarray(part.position) + _points(part) @ _rotation(part.euler).T


def _points(part: Part) -> FloatArray:
    if part.shape == "box":
        signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
        return np.asarray(signs * np.array(part.size))
    radius = part.size[0]
    half = part.size[1] if len(part.size) > 1 else 0.0
    if part.shape == "cylinder":
        ring = radius * np.stack([np.cos(CIRCLE), np.sin(CIRCLE), 0.0 * CIRCLE], axis=1)
        return np.concatenate([ring + [0.0, 0.0, half], ring - [0.0, 0.0, half]])
    turn, tilt = (angle.ravel() for angle in np.meshgrid(CIRCLE, np.linspace(-np.pi / 2, np.pi / 2, 13)))
    level = np.cos(tilt)
    ball = radius * np.stack([level * np.cos(turn), level * np.sin(turn), np.sin(tilt)], axis=1)
    return np.concatenate([ball + [0.0, 0.0, half], ball - [0.0, 0.0, half]])


def _rotation(euler: tuple[float, float, float]) -> FloatArray:
    """Return MuJoCo's rotation matrix of angles about x, y and z, each about the axes turned before."""
    turned = np.eye(3)
    for axis, angle in zip(np.eye(3), euler, strict=True):
        turned = turned @ cv2.Rodrigues(angle * axis)[0]
    return np.asarray(turned)
