"""How far a training on the robot is: episodes, skills, hours on the robot's clock."""

import csv
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from taskschema_robot.agent.episode import EpisodeRecord

RECENT = 100
"""Training stops at 90 % success over so many episodes (paper)."""
COLUMNS = (
    "round",
    "slot",
    "attempt",
    "success",
    "steps",
    "skills",
    "refused",
    "seconds",
    "hours",
    "last_100",
    "evidence",
)
DROPPED_COLUMNS = ("round", "slot", "attempt", "skills", "refused", "seconds", "hours", "reason")


@dataclass
class Progress:
    """Counts episodes, a row of `episodes.csv` each, and tries that do not count, of `dropped.csv` beside it.

    Goes on from what is there.
    """

    path: Path
    episodes: int = 0
    dropped: int = 0
    """Tries that ended with a fault, an unknown outcome or a person's word."""
    skills: int = 0
    """Begun, counting each arm's that is not a no-op; those of refused steps and dropped tries included."""
    seconds: float = 0.0
    """On the robot's clock, dropped tries and their recovery included."""
    recent: deque[bool] = field(default_factory=lambda: deque(maxlen=RECENT))

    def __post_init__(self) -> None:
        """Go on from what is there."""
        self.dropped_path = self.path.with_name("dropped.csv")
        for row in _rows(self.path, COLUMNS):
            self.episodes += 1
            self.skills += int(row["skills"])
            self.seconds += float(row["seconds"])
            self.recent.append(row["success"] == "1")
        for row in _rows(self.dropped_path, DROPPED_COLUMNS):
            self.dropped += 1
            self.skills += int(row["skills"])
            self.seconds += float(row["seconds"])

    @property
    def success(self) -> float:
        """Success rate over the last 100 episodes."""
        return sum(self.recent) / len(self.recent) if self.recent else 0.0

    @property
    def hours(self) -> float:
        """On the robot's clock."""
        return self.seconds / 3600.0

    def add(self, round_index: int, slot: int, attempt: int, success: bool, record: EpisodeRecord) -> None:
        """Count an episode."""
        skills = _skills(record)
        self.episodes += 1
        self.skills += skills
        self.seconds += record.seconds
        self.recent.append(success)
        numbers = (round_index, slot, attempt, int(success), len(record.skills), skills, len(record.refusals))
        words = (f"{record.seconds:.2f}", f"{self.hours:.4f}", f"{self.success:.3f}", record.evidence)
        _append(self.path, [*numbers, *words])

    def add_dropped(
        self, round_index: int, slot: int, attempt: int, record: EpisodeRecord, reason: str
    ) -> None:
        """Count a try that does not count as an episode: its time and skills, with the reason."""
        skills = _skills(record)
        self.dropped += 1
        self.skills += skills
        self.seconds += record.seconds
        numbers = (round_index, slot, attempt, skills, len(record.refusals))
        _append(self.dropped_path, [*numbers, f"{record.seconds:.2f}", f"{self.hours:.4f}", reason])

    def hours_left(self, goal: float = 0.9) -> float | None:
        """Return the hours to `goal` if success grows on as in the last 100 episodes; None: unknown."""
        half = len(self.recent) // 2
        if half < RECENT // 4:
            return None
        earlier, later = list(self.recent)[:half], list(self.recent)[half:]
        growth = sum(later) / len(later) - sum(earlier) / len(earlier)
        if self.success >= goal:
            return 0.0
        if growth <= 0.0:
            return None
        episodes = (goal - self.success) / growth * half
        return episodes * self.hours / self.episodes


def _rows(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    """Return the rows of a file, which is begun if there is none, and gets the columns that it lacks."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        found, rows = reader.fieldnames, list(reader)
    if found != list(columns):
        part = path.with_suffix(".part")
        with part.open("w", newline="") as file:
            writer = csv.DictWriter(file, columns, restval="")
            writer.writeheader()
            writer.writerows(rows)
        part.replace(path)
    return rows


def _append(path: Path, row: Sequence[object]) -> None:
    with path.open("a", newline="") as file:
        csv.writer(file).writerow(row)


def _skills(record: EpisodeRecord) -> int:
    return sum(name != "no_op" for pair in record.skills for name in pair)
