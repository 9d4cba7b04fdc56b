"""What a training's first lines say."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from taskschema.config import RunConfig
from taskschema.tasks import get_task
from taskschema_learner.runs.progress import Limits, Progress
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.training import TrainingContext
from taskschema_learner.views.terminal import TerminalObserver


class NoLog:
    def write_to(self, folder: Path) -> None:
        pass


@pytest.mark.parametrize(
    ("agent", "workers", "words"),
    [
        ("simulation", 3, "3 workers"),
        ("simulation", None, "in this process"),
        ("simulation", 0, "0 workers asked for: `taskschema scale N`"),
        ("robot", None, "waiting for `taskschema-robot run runs/bar`"),
    ],
)
def test_the_start_says_who_runs_the_episodes(agent, workers, words):
    screen = io.StringIO()
    observer = TerminalObserver(Console(file=screen), NoLog(), "")
    folder = RunFolder(Path("runs/bar"), RunConfig(task="toy"), agent, None)
    context = TrainingContext(folder, get_task("toy"), Limits(), workers, agent, None, None)
    observer.on_start(context, 0, Progress())
    assert f"Run folder: runs/bar ({words}); stops at 90%" in screen.getvalue()
