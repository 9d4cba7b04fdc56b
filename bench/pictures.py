"""Draw the pictures in docs/pictures: every task solved, every skill's motion, and what varied looks are.

`python -m bench.pictures [NAME ...]`, or `make pictures` for all of them.
"""

import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
from PIL import Image

from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema.tasks.registry import get_task, task_names
from taskschema.tasks.scene_task import SceneTask

OUT = Path("docs/pictures")
OPTIONS = ("--episodes", "1", "--width", "400", "--height", "300")
SHOWN_IN = {
    "top_grasp": ("lateral-lifting", 1),
    "side_grasp": ("opening", 1),
    "go_to_pose": ("rotating", 1),
    "lift": ("lateral-lifting", 2),
    "twist": ("opening", 2),
    "rotate": ("rotating", 3),
    "no_op": ("rotating", 2),
}
"""Task and step of the scripted expert that the film of a skill's motion shows."""


VISUALS = "randomised-visuals"
VISUALS_SHOWN = (2, 4)
"""Rows and columns of first frames of episodes with `--randomise-visuals`."""


def draw_visuals(path: Path) -> None:
    """Draw the first frames of lateral lifting's first episodes of seed 0 as a table."""
    from taskschema_worker.environments import make_environment

    rows, columns = VISUALS_SHOWN
    keys = [EpisodeKey(0, 0, 0, episode) for episode in range(rows * columns)]
    with closing(make_environment(LateralLifting(), 1, "image", randomise_visuals=True)) as environment:
        frames = environment.reset([generator(key, Purpose.RESET) for key in keys])
    table = [np.concatenate(list(row), axis=1) for row in np.split(frames, rows)]
    Image.fromarray(np.concatenate(table)).resize((128 * columns, 128 * rows)).save(path)


def main() -> None:
    films = {name: ["--expert", name] for name in task_names() if isinstance(get_task(name), SceneTask)} | {
        skill.replace("_", "-"): ["--expert", task, "--step", str(step), "--camera", "close"]
        for skill, (task, step) in SHOWN_IN.items()
    }
    films["tray"] = ["--task-file", "docs/examples/tray.py:Tray"]
    OUT.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or [*films, VISUALS]:
        if name == VISUALS:
            draw_visuals(OUT / f"{VISUALS}.jpg")
            continue
        options = [*OPTIONS, "--output", str(OUT / f"{name}.gif")]
        subprocess.run(
            [sys.executable, "-m", "taskschema_learner", "replay", *films[name], *options], check=True
        )


if __name__ == "__main__":
    main()
