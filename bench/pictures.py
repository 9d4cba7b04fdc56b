"""Draw the films in docs/pictures: every task solved, and the motion of every skill.

`python -m bench.pictures [NAME ...]`, or `make pictures` for all of them.
"""

import subprocess
import sys
from pathlib import Path

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


def main() -> None:
    films = {name: ["--expert", name] for name in task_names() if isinstance(get_task(name), SceneTask)} | {
        skill.replace("_", "-"): ["--expert", task, "--step", str(step), "--camera", "close"]
        for skill, (task, step) in SHOWN_IN.items()
    }
    films["tray"] = ["--task-file", "docs/examples/tray.py:Tray"]
    OUT.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or films:
        options = [*OPTIONS, "--out", str(OUT / f"{name}.gif")]
        subprocess.run(
            [sys.executable, "-m", "taskschema_learner", "replay", *films[name], *options], check=True
        )


if __name__ == "__main__":
    main()
