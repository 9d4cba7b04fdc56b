"""A picture of a motion or of its refusal: both arms from above and from the side, for a person."""

from pathlib import Path
from typing import Any

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.safety.arm_model import ArmModel
from taskschema.safety.motion import Motion
from taskschema.safety.refusal import Refusal

COLOURS = {0: "tab:blue", 1: "tab:orange", None: "tab:gray"}
VIEWS = (("from above", 0, 1), ("from the right, along -x", 1, 2))
"""Title, and which world axes run to the right and up."""


def draw_motion(path: Path, motion: Motion, refusal: Refusal | None, title: str) -> None:
    """Write a PNG: the hands' ways, the arms where they end or it was refused, what comes too near in red."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    model = ArmModel()
    shown = (
        motion.joints[:, -1] if refusal is None or refusal.configuration is None else refusal.configuration
    )
    figure = Figure(figsize=(10, 5), layout="constrained")
    FigureCanvasAgg(figure)
    trace = _grips(model, motion.joints[:, :: max(1, len(motion) // 100)])
    for place, (name, across, up) in enumerate(VIEWS):
        axes = figure.add_subplot(1, 2, place + 1, aspect="equal", title=name)
        axes.set_xlabel(f"{'xyz'[across]} [m]")
        axes.set_ylabel(f"{'xyz'[up]} [m]")
        if up == 2:
            axes.axhline(0.0, color=COLOURS[None])
        for arm in (0, 1):
            axes.plot(trace[:, arm, across], trace[:, arm, up], ":", color=COLOURS[arm])
        _draw_arms(axes, model, shown, across, up, refusal.bodies if refusal is not None else ())
    figure.suptitle(title if refusal is None else f"{title}\nrefused: {refusal.reason}", fontsize=10)
    figure.savefig(path, dpi=80)


def _grips(model: ArmModel, joints: FloatArray) -> FloatArray:
    """Return where both hands are [S, 2, 3]."""
    centres, _ = model.poses(joints)
    return centres[:, [model.index(arm, "gripper_base_0") for arm in (0, 1)]]


def _draw_arms(
    axes: Any,  # noqa: ANN401 - matplotlib is imported only where it draws
    model: ArmModel,
    joints: FloatArray,
    across: int,
    up: int,
    near: tuple[str, ...],
) -> None:
    centres, frames = model.poses(joints[:, None])
    for index, shape in enumerate(model.shapes):
        if shape.arm is None or (shape.link == "held" and shape.name not in near):
            continue
        half, radius = model.capsule(index)
        ends = centres[0, index] + np.outer([-1.0, 1.0], frames[0, index, :, 2] * half)
        colour = "red" if shape.name in near else COLOURS[shape.arm]
        axes.plot(ends[:, across], ends[:, up], color=colour, lw=2)
        for end in ends:
            circle = np.linspace(0.0, 2.0 * np.pi, 40)
            axes.plot(
                end[across] + radius * np.cos(circle), end[up] + radius * np.sin(circle), color=colour, lw=0.7
            )
