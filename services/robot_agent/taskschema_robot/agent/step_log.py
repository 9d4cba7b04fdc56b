"""Every step that was made, refused or broken off, a line of JSON each."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from taskschema.arrays import FloatArray
from taskschema.randomness import EpisodeKey
from taskschema.safety.motion import Motion
from taskschema.safety.refusal import Refusal
from taskschema_robot.safety.fault import Fault

log = logging.getLogger("taskschema.robot")


@dataclass(frozen=True, eq=False)
class StepRecord:
    """What was asked of both arms in one step, and what came of it."""

    key: EpisodeKey
    step: int
    """0..T-1."""
    skills: tuple[str, str]
    """Left arm first."""
    arguments: dict[str, float]
    """Of these skills, by name [m, rad], as they were planned from: offsets from the object."""
    pose: FloatArray
    """[7 + h] the object's, as it was known when the step was planned."""
    motion: Motion
    began: float
    """On the agent's clock [s]."""
    seconds: float = 0.0
    """That it took; none, if it was refused."""
    refusal: Refusal | None = None
    fault: Fault | None = None
    """What broke it off."""


StepListener = Callable[[StepRecord], None]
"""Told about every step once it is over."""


class StepLog:
    """Appends steps to a file; one that cannot be written is only said in the log.

    Args:
        path: of the file, `steps.jsonl`.

    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def __call__(self, record: StepRecord) -> None:
        """Append a step."""
        line = {
            "time": record.began,
            "round": record.key.round,
            "slot": record.key.slot,
            "attempt": record.key.attempt,
            "step": record.step,
            "skills": record.skills,
            "arguments": record.arguments,
            "refused": None if record.refusal is None else record.refusal.reason,
            "fault": None if record.fault is None else record.fault.reason,
            "seconds": round(record.seconds, 3),
            "pose": record.pose.tolist(),
        }
        try:
            with self._path.open("ab") as file:
                file.write(msgspec.json.encode(line) + b"\n")
        except OSError as error:
            log.warning("A step is not in %s: %s", self._path, error)
