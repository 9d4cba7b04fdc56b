"""Row 13: minutes and episodes to 90 % of the seeds that `taskschema experiment paper-sim` trained."""

from pathlib import Path

from bench.entry import Entry
from bench.service_process import TASK
from taskschema_learner.experiment.results_folder import ResultsFolder

RESULTS = Path(__file__).parents[1] / "results" / "paper-sim"


def measure(repeats: int, folder: Path = RESULTS) -> list[Entry]:
    """Read the experiment's results; nothing is trained, and without results there is nothing to say."""
    if not ResultsFolder.is_one(folder):
        return []
    cells = ResultsFolder(folder).read().cells
    over = [cell for cell in cells if (cell.task, cell.policy) == (TASK, "schema") and cell.is_over]
    done = [cell for cell in over if cell.state == "solved"]
    print(f"  {len(done)} of {len(over)} seeds reached 90 %")
    if not done:
        return []
    minutes, episodes = [cell.minutes for cell in done], [float(cell.episodes) for cell in done]
    return [
        Entry.of(13, f"`make train` to 90 %, median of {len(done)} seeds", minutes, "min", 15, "lower"),
        Entry.of(13, f"episodes to 90 %, median of {len(done)} seeds", episodes, "", None, "lower"),
    ]
