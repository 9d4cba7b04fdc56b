"""The person beside the robots, as the agent asks them."""

from typing import Protocol

from taskschema_robot.agent.episode import EpisodeRecord
from taskschema_robot.agent.progress import Progress
from taskschema_robot.safety.fault import Fault


class Operator(Protocol):
    """Answers what the agent cannot know."""

    def begin(self, progress: Progress, key: str) -> None:
        """Show what happens next; waits while paused."""
        ...

    def review(self, record: EpisodeRecord) -> bool | None:
        """Return the outcome after a person had a look: True, False, or None to drop the episode."""
        ...

    def acknowledge(self, fault: Fault) -> str:
        """Show why the arms stopped; return who acknowledged it, once they have."""
        ...

    def release(self, reason: str) -> None:
        """Ask for what the hands hold in the air to be taken, as it cannot be put down; then they open."""
        ...

    def dropped(self, reason: str) -> None:
        """Say that an episode does not count, and why."""
        ...


class Unattended:
    """Nobody: for a twin, whose faults are tests. Outcomes stand, faults are acknowledged at once."""

    def begin(self, progress: Progress, key: str) -> None:
        """Go on; see `Operator`."""

    def review(self, record: EpisodeRecord) -> bool | None:
        """Let the outcome stand; see `Operator`."""
        return record.outcome == "success"

    def acknowledge(self, fault: Fault) -> str:
        """Acknowledge; see `Operator`."""
        return "nobody (a twin)"

    def release(self, reason: str) -> None:
        """Let it fall; see `Operator`."""

    def dropped(self, reason: str) -> None:
        """Go on; see `Operator`."""
