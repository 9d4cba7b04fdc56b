"""How far a training on the robot is: episodes, skills, hours on the robot's clock."""

import csv
from collections import deque
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
)


@dataclass
class Progress:
    """Counts episodes and writes a row of `episodes.csv` for each."""

    path: Path
    episodes: int = 0
    skills: int = 0
    """Executed, counting each arm's that is not a no-op."""
    seconds: float = 0.0
    """On the robot's clock."""
    recent: deque[bool] = field(default_factory=lambda: deque(maxlen=RECENT))

    def __post_init__(self) -> None:
        """Go on from what is there."""
        if self.path.exists():
            with self.path.open(newline="") as file:
                for row in csv.DictReader(file):
                    self.episodes += 1
                    self.skills += int(row["skills"])
                    self.seconds += float(row["seconds"])
                    self.recent.append(row["success"] == "1")
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("w", newline="") as file:
            csv.writer(file).writerow(COLUMNS)

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
        skills = sum(name != "no_op" for pair in record.skills for name in pair)
        self.episodes += 1
        self.skills += skills
        self.seconds += record.seconds
        self.recent.append(success)
        numbers = (round_index, slot, attempt, int(success), len(record.skills), skills, len(record.refusals))
        with self.path.open("a", newline="") as file:
            csv.writer(file).writerow(
                [*numbers, f"{record.seconds:.2f}", f"{self.hours:.4f}", f"{self.success:.3f}"]
            )

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
