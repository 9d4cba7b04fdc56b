"""Row 13: minutes and episodes to 90 % of the five seeds that `python -m bench.seeds` trained."""

import csv
from pathlib import Path

from bench.entry import Entry
from bench.service_process import TASK

RESULTS = Path(__file__).parents[1] / "results"
REACHED = 0.9


def measure(repeats: int, folder: Path | None = None) -> list[Entry]:
    """Read the seeds' curves; nothing is trained, and without curves there is nothing to say."""
    folder = folder or RESULTS / TASK
    paths = sorted(folder.glob("seed*.csv"))
    curves = [list(csv.DictReader(path.open(newline=""))) for path in paths]
    done = [rows for rows in curves if rows and float(rows[-1]["success_last_100"]) >= REACHED]
    print(f"  {len(done)} of {len(curves)} seeds reached {REACHED:.0%}")
    if not done:
        return []
    minutes = [sum(map(_seconds, rows)) / 60 for rows in done]
    episodes = [float(rows[-1]["episodes"]) for rows in done]
    return [
        Entry.of(13, f"`make train` to 90 %, median of {len(done)} seeds", minutes, "min", 15, "lower"),
        Entry.of(13, f"episodes to 90 %, median of {len(done)} seeds", episodes, "", None, "lower"),
    ]


def _seconds(row: dict[str, str]) -> float:
    return sum(float(row[f"seconds_{phase}"]) for phase in ("collect", "update", "checkpoint"))
