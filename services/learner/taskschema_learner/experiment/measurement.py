"""What a cell's run folder says: its result, and its learning curve thinned to a small table."""

import subprocess
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from taskschema.metrics import RoundMetrics
from taskschema.tasks.registry import get_task, task_of
from taskschema_learner.evaluation import SuccessRate, held_out_episodes, wilson
from taskschema_learner.experiment.cell import Cell, CellResult, CellState
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import newest_policy
from taskschema_learner.schemas.schema_report import compare, compare_used
from taskschema_learner.views.plots import TARGET

CURVE_ROWS = 300
"""Most rows of a cell's table."""
HELD_OUT_EPISODES = 200
"""Episodes that a solved cell's policy is measured on."""
SOURCES = ("shared", "services")
"""Folders of the source tree that results depend on."""


def measure(folder: RunFolder, cell: Cell, budget: int) -> CellResult | None:
    """Return a cell's result so far; None before its first round.

    Raises:
        TaskschemaError: if the run's files are damaged.

    """
    rows = folder.read_metrics()
    if not rows:
        return None
    last = rows[-1]
    state: CellState = "interrupted"
    if last.success_last_100 >= TARGET:
        state = "solved"
    elif last.episodes >= budget:
        state = "not solved"
    comparison = None
    if cell.policy != "state":
        comparison = compare(task_of(folder.config), folder.read_schema().best)
    seconds = sum(row.seconds_collect + row.seconds_update + row.seconds_checkpoint for row in rows)
    return CellResult(
        task=cell.task,
        policy=cell.policy,
        seed=cell.seed,
        state=state,
        episodes=last.episodes,
        rounds=last.policy_version,
        budget=budget,
        minutes=round(seconds / 60, 2),
        success_last_100=last.success_last_100,
        schema=None if comparison is None else comparison.found,
        verdict=None if comparison is None else comparison.verdict,
        config_hash=folder.config.config_hash,
        sha256=last.sha256,
        commit=source_commit(),
        steps=last.steps,
    )


def judged(result: CellResult) -> CellResult:
    """Return a cell with the verdict that its schema has with the good set of today.

    Raises:
        TaskschemaError: if its task is not there any more.

    """
    if result.schema is None:
        return result
    verdict = compare_used(get_task(result.task), result.schema).verdict
    return msgspec.structs.replace(result, verdict=verdict)


def held_out_success(folder: RunFolder) -> SuccessRate:
    """Return how often the newest policy succeeds with mean actions where it was not trained.

    Raises:
        RunFolderError: if the run's policy is damaged.

    """
    episodes = held_out_episodes(folder, newest_policy(folder), HELD_OUT_EPISODES, mean=True)
    return wilson(sum(item.success for item in episodes), len(episodes))


def thinned_curve(rows: Sequence[RoundMetrics]) -> list[tuple[int, float]]:
    """Return (episodes, success over the last 100) of evenly spread rounds, the last one among them."""
    if not rows:
        return []
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), CURVE_ROWS)).round().astype(int))
    return [(rows[index].episodes, rows[index].success_last_100) for index in chosen]


def source_commit() -> str:
    """Return the short commit of the source tree that runs, `+` behind it if code differs; else nothing."""
    try:
        commit, root = _git("rev-parse", "--short", "HEAD"), _git("rev-parse", "--show-toplevel")
        changed = _git("status", "--porcelain", "--", *(f"{root}/{folder}" for folder in SOURCES))
    except (OSError, subprocess.SubprocessError):
        return ""
    return f"{commit}+" if changed else commit


def _git(*words: str) -> str:
    command = ["git", "-C", str(Path(__file__).parent), *words]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=30).stdout.strip()
