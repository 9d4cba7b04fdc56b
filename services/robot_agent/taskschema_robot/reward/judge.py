"""The outcome of an episode: success, failure or unknown, with the picture that shows it."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np

from taskschema.arrays import FloatArray
from taskschema.tasks.scene_task import SceneTask
from taskschema_robot.agent.kept_files import KeptFiles
from taskschema_robot.reward.detector import draw_found
from taskschema_robot.reward.tracker import Sighting

FRAMES = 10
"""Frames whose median counts, after everything has settled."""
LEAST_FRAMES = 6
"""Fewer known ones of them make the outcome unknown."""
STEADY = 0.02
"""Largest spread of the known positions [m]: more means that it still moves, or that a pose is wrong."""


class Outcome(StrEnum):
    """What the pictures show."""

    SUCCESS = "success"
    FAILURE = "failure"
    UNKNOWN = "unknown"
    """Hidden, or not certain: never a failure. A person is asked, or the episode is dropped."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """An outcome and why."""

    outcome: Outcome
    reason: str
    """One line for a person."""
    pose: FloatArray | None = None
    """[7 + h] the object's median pose, if it is known."""
    evidence: Sighting | None = None
    """The last frame looked at."""
    picture: str = ""
    """Name of the file that shows it; empty: none was kept."""


def median_pose(sightings: Sequence[Sighting]) -> tuple[FloatArray | None, str]:
    """Return the median pose [7 + h] of settled frames, or None and why not."""
    known = [sighting.pose for sighting in sightings if sighting.pose is not None]
    if len(known) < LEAST_FRAMES:
        reasons = [sighting.reason for sighting in sightings if sighting.pose is None]
        return None, reasons[-1] if reasons else f"{len(known)} new pictures came, {LEAST_FRAMES} are needed"
    poses = np.stack(known)
    signs = np.sign((poses[:, 3:7] * poses[0, 3:7]).sum(axis=1, keepdims=True))
    poses[:, 3:7] *= np.where(signs == 0.0, 1.0, signs)
    spread = float((poses[:, :3].max(axis=0) - poses[:, :3].min(axis=0)).max())
    if spread > STEADY:
        return None, f"its position is not steady: {100 * spread:.1f} cm between frames"
    pose = np.median(poses, axis=0)
    pose[3:7] /= np.sqrt((pose[3:7] ** 2).sum())
    return pose, ""


def judge(task: SceneTask, start: FloatArray, sightings: Sequence[Sighting]) -> Judgement:
    """Judge settled frames by the family's own goal.

    Args:
        task: of the object's family: its `goal_reached` decides, as in simulation.
        start: [7 + h] the object's pose at the start of the episode.
        sightings: about `FRAMES` of them, newest last.
    """
    evidence = sightings[-1] if sightings else None
    pose, reason = median_pose(sightings)
    if pose is None:
        return Judgement(Outcome.UNKNOWN, reason, None, evidence)
    reached = _reached(task, start, pose)
    if (
        any(sighting.doubtful for sighting in sightings)
        and _reached(task, start, _turn_behind(pose)) != reached
    ):
        reason = "nobody saw which way its turning part was turned"
        return Judgement(Outcome.UNKNOWN, reason, pose, evidence)
    distance = float(task.goal_distance(start[None], pose[None, None])[0, 0])
    outcome = Outcome.SUCCESS if reached else Outcome.FAILURE
    words = "the goal is reached" if reached else f"{distance:.2f} tolerances or shares short of the goal"
    return Judgement(outcome, words, pose, evidence)


def _reached(task: SceneTask, start: FloatArray, pose: FloatArray) -> bool:
    return bool(task.goal_reached(start[None], pose[None, None])[0, 0])


def _turn_behind(pose: FloatArray) -> FloatArray:
    """Return a pose [7 + h] with its hinge a full turn behind."""
    return np.concatenate([pose[:7], pose[7:] - 2.0 * np.pi])


def keep_evidence(judgement: Judgement, files: KeptFiles, name: str) -> Judgement:
    """Write the picture an outcome was judged by, markers outlined, outcome written in; say which it is."""
    if judgement.evidence is None:
        return judgement
    picture = draw_found(judgement.evidence.frame.image, judgement.evidence.found)
    text = f"{judgement.outcome}: {judgement.reason}"
    cv2.putText(picture, text, (10, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (255, 0, 0), 2)
    path = files.place(f"{name}-{judgement.outcome}")
    cv2.imwrite(str(path), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    return dataclasses.replace(judgement, picture=path.name)
