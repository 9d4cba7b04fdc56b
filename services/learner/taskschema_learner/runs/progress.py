"""How far a run has come: the counters behind its metrics and its stopping rule."""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from taskschema.trajectory import Trajectory

WINDOW = 100
"""Episodes that the stopping rule looks at (paper: success rate over the last 100 episodes)."""


class Progress(msgspec.Struct, frozen=True):
    """Counters after a number of rounds; part of every checkpoint."""

    episodes: int = 0
    """Episodes so far."""
    steps: int = 0
    """Skill pairs executed so far."""
    outcomes: tuple[bool, ...] = ()
    """Outcomes of the last 100 episodes, in the order of rounds, slots and episodes."""

    def after(self, trajectories: Sequence[Trajectory]) -> "Progress":
        """Return the counters after one more round, whose trajectories are sorted by slot and episode."""
        outcomes = (*self.outcomes, *(item.success for item in trajectories))[-WINDOW:]
        return Progress(
            episodes=self.episodes + len(trajectories),
            steps=self.steps + sum(map(len, trajectories)),
            outcomes=outcomes,
        )

    @property
    def success_last_100(self) -> float:
        """Share of successes among the last 100 episodes; 0 while there are fewer."""
        return sum(self.outcomes) / WINDOW if len(self.outcomes) == WINDOW else 0.0


@dataclass(frozen=True)
class Limits:
    """When training stops; not part of the config, because results up to there do not depend on it."""

    until_success: float | None = 0.9
    """Success over the last 100 episodes that is enough (paper: 0.9); None: never enough."""
    rounds: int | None = None
    """Rounds in all; None: as many as it takes."""

    def reached(self, progress: Progress, rounds_done: int) -> str | None:
        """Return why training is finished, or None if it goes on."""
        if self.until_success is not None and progress.success_last_100 >= self.until_success:
            return f"success over the last {WINDOW} episodes reached {progress.success_last_100:.0%}"
        if self.rounds is not None and rounds_done >= self.rounds:
            return f"{rounds_done} rounds are done"
        return None
