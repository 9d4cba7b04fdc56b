"""Pictures of response maps: where on the table each arm would go, laid over what the camera sees."""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.errors import ConfigError
from taskschema.frames import FRAME_SIZE, Frames
from taskschema.policies import ImagePolicy, policy_of
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.skills.pairs import ARMS
from taskschema.tasks.registry import task_of
from taskschema.tasks.task import Task
from taskschema_learner.evaluation import HELD_OUT
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import newest_policy
from taskschema_learner.views.plots import new_figure, save_figure
from taskschema_worker.environments import environment_of

EXAMPLES = 3
"""Instances in one picture."""
COLOUR_MAPS = ("Reds", "Blues")
"""Of the left and the right arm."""


@dataclass(frozen=True)
class Example:
    """One instance as the camera and the policy see it."""

    frame: Frames
    """[256, 256, 3]"""
    maps: FloatArray
    """[2, 8, 8] each arm's distribution over the table."""


def examples(folder: RunFolder, count: int = EXAMPLES) -> list[Example]:
    """Return the first steps of a run's first held-out instances.

    Raises:
        ConfigError: if the run's policy does not see images.
        RunFolderError: if it has no policy yet, or a damaged one.
        RenderingError: if nothing on this machine can draw.

    """
    task = task_of(folder.config)
    policy = policy_of(folder.config, task, newest_policy(folder))
    if not isinstance(policy, ImagePolicy):
        raise ConfigError(f"Run {folder.name} sees states: only runs on images have response maps.")
    keys = [EpisodeKey(folder.config.seed + HELD_OUT, 0, slot, 0) for slot in range(count)]
    with closing(environment_of(folder.config, task)) as environment:
        frames = environment.reset([generator(key, Purpose.RESET) for key in keys])
    maps = policy.response_maps(frames)
    return [Example(frame, pair) for frame, pair in zip(frames, maps, strict=True)]


def plot_response_maps(folder: RunFolder, path: Path) -> None:
    """Draw a row for each example, a column for each arm; see `examples` for the errors.

    Raises:
        RunFolderError: also if the picture cannot be written.

    """
    task, shown = task_of(folder.config), examples(folder)
    figure, axes = new_figure(len(shown), len(ARMS))
    left, right, bottom, top = map_extent(task)
    for row, example in enumerate(shown):
        for arm, name in enumerate(ARMS):
            axis = axes[len(ARMS) * row + arm]
            axis.grid(visible=False)
            axis.imshow(example.frame)
            overlay = axis.imshow(
                example.maps[arm],
                cmap=COLOUR_MAPS[arm],
                alpha=opacity(example.maps[arm]),
                extent=(left, right, bottom, top),
                vmin=0.0,
            )
            figure.colorbar(overlay, ax=axis, label="probability of a cell")
            axis.set(xlim=(0, FRAME_SIZE), ylim=(FRAME_SIZE, 0), xticks=[], yticks=[], title=f"{name} arm")
    figure.suptitle(f"{folder.name}, {task.name}: where each arm goes first")
    save_figure(figure, path)


def map_extent(task: Task) -> tuple[float, float, float, float]:
    """Return the response map's left, right, lower and upper edge in a frame [pixel]; rows count downwards.

    Of the table's plane: what stands higher appears further from the middle.
    """
    scale = FRAME_SIZE / task.table_view
    x, y = task.table.x, task.table.y
    middle = 0.5 * FRAME_SIZE
    return middle + scale * x[0], middle + scale * x[1], middle - scale * y[0], middle - scale * y[1]


def opacity(response: FloatArray) -> FloatArray:
    """Return how much of each cell [8, 8] hides the frame: the likelier than others, the more."""
    return np.asarray(0.1 + 0.7 * (response - response.min()) / response.max())
