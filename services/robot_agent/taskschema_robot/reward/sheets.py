"""Marker sheets to print, to scale, and where an object's markers go."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from taskschema_robot.objects.marker import DICTIONARY, Marker, table_markers
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.placement import draw_placement

PAGE = (0.210, 0.297)
"""A4 [m]."""
MARGIN = 0.015
"""[m]"""
METRES_PER_INCH = 0.0254
CELLS = 6
"""Of a 4 x 4 marker with its black border; a white cell around it belongs to it."""


def write_sheets(path: Path, item: RobotObject | None) -> int:
    """Write the table's markers and an object's as a PDF of A4 pages; return how many pages.

    The last page shows where the object's go: it is not to scale.
    """
    from matplotlib.backends.backend_pdf import PdfPages

    titles = {"table": list(table_markers())}
    if item is not None:
        titles[item.name] = list(item.markers)
        if item.joint_markers:
            titles[f"{item.name}, turning part"] = list(item.joint_markers)
    pages = [(title, page) for title, markers in titles.items() for page in _pages(markers)]
    count = len(pages) + (item is not None)
    with PdfPages(path) as pdf:
        for number, (title, page) in enumerate(pages):
            pdf.savefig(_draw(title, number + 1, count, page))
        if item is not None:
            pdf.savefig(_draw_places(item, count))
    return count


def _pages(markers: Sequence[Marker]) -> list[list[tuple[Marker, float, float]]]:
    """Return markers with the left and lower edge of their white border on the page [m], row by row."""
    pages: list[list[tuple[Marker, float, float]]] = [[]]
    x, top, row = MARGIN, PAGE[1] - 2 * MARGIN, 0.0
    for marker in markers:
        side = _with_border(marker) + 0.012
        if x + side > PAGE[0] - MARGIN:
            x, top, row = MARGIN, top - row, 0.0
        if top - side < MARGIN + 0.03:
            pages.append([])
            x, top, row = MARGIN, PAGE[1] - 2 * MARGIN, 0.0
        pages[-1].append((marker, x, top - side))
        x, row = x + side, max(row, side)
    return pages


def _with_border(marker: Marker) -> float:
    return marker.size * (CELLS + 2) / CELLS


def _draw(title: str, number: int, count: int, page: list[tuple[Marker, float, float]]):  # type: ignore[no-untyped-def]  # noqa: ANN202
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE[0] / METRES_PER_INCH, PAGE[1] / METRES_PER_INCH))
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    for marker, left, bottom in page:
        edge = _with_border(marker)
        face = cv2.aruco.generateImageMarker(dictionary, marker.number, CELLS)
        face = cv2.copyMakeBorder(face, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=255)
        axes = figure.add_axes((left / PAGE[0], bottom / PAGE[1], edge / PAGE[0], edge / PAGE[1]))
        axes.imshow(face, cmap="gray", vmin=0, vmax=255, interpolation="none", aspect="auto")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(f"{marker.number}: {1000 * marker.size:.0f} mm, top up", fontsize=6, pad=2)
    _draw_ruler(figure)
    figure.text(
        0.5, 0.96, f"{title} (page {number} of {count}): print at 100 %, cut along the frames", ha="center"
    )
    return figure


def _draw_places(item: RobotObject, count: int):  # type: ignore[no-untyped-def]  # noqa: ANN202
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PAGE[0] / METRES_PER_INCH, PAGE[1] / METRES_PER_INCH))
    title = f"{item.name} (page {count} of {count}): where its markers go; not to scale"
    figure.text(0.5, 0.96, title, ha="center")
    draw_placement(figure, item)
    return figure


def _draw_ruler(figure) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
    """Draw 100 mm to check the print with a ruler."""
    from matplotlib.lines import Line2D

    left, width, height = MARGIN / PAGE[0], 0.1 / PAGE[0], 0.012 / PAGE[1]
    for mark in np.linspace(0.0, 1.0, 11):
        place = left + mark * width
        figure.add_artist(Line2D([place, place], [height, height * 1.4], color="black", lw=0.5))
    figure.add_artist(Line2D([left, left + width], [height, height], color="black", lw=0.5))
    figure.text(left + width + 0.01, height, "100 mm: measure it", fontsize=7)
