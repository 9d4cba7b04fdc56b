"""Finding runs by folder or name, and naming new ones."""

import re
from pathlib import Path

from taskschema.errors import UnknownNameError
from taskschema_learner.runs.run_folder import RunFolder

RUNS = Path("runs")
"""Where runs go and are looked for, below the working directory."""


def find_run(reference: str) -> RunFolder:
    """Open a run by its folder, or by its name below `runs/`.

    Raises:
        UnknownNameError: if there is no such run; RunFolderError: if its folder is damaged.

    """
    for path in (Path(reference), RUNS / reference):
        if (path / "config.json").exists():
            return RunFolder.open(path)
    raise UnknownNameError("run", reference, [path.name for path in known_runs()])


def run_name(reference: str) -> str:
    """Return the name of a run that is given by its folder or its name, wherever it is."""
    return Path(reference).resolve().name


def known_runs() -> list[Path]:
    """Return the folders of the runs below `runs/`."""
    return sorted(path.parent for path in RUNS.glob("*/config.json"))


def new_run_dir(task: str, policy: str, seed: int) -> Path:
    """Return a folder for a new run: `runs/TASK-POLICY-seedN`, with a number if there is one already."""
    base = _base(task, policy, seed)
    taken = _numbers(base)
    return RUNS / (f"{base}-{max(taken) + 1}" if taken else base)


def newest_run_dir(task: str, policy: str, seed: int) -> Path:
    """Return the folder of the newest run of this task, policy and seed, or where the first would be."""
    base = _base(task, policy, seed)
    newest = max(_numbers(base), default=1)
    return RUNS / (base if newest == 1 else f"{base}-{newest}")


def _base(task: str, policy: str, seed: int) -> str:
    return f"{task.lower()}-{policy}-seed{seed}"


def _numbers(base: str) -> list[int]:
    """Return the numbers of the runs that are called so; the first has no number and counts as 1."""
    matches = [re.fullmatch(rf"{re.escape(base)}(?:-(\d+))?", path.name) for path in known_runs()]
    return [int(match[1] or 1) for match in matches if match is not None]
