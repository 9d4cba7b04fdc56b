"""The object as the overhead camera sees it, put back by a person."""

import dataclasses
from pathlib import Path
from typing import Protocol

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.rotation import rotate
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema_robot.agent.kept_files import KeptFiles
from taskschema_robot.agent.start_pose import start_pose
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.camera.camera import Camera
from taskschema_robot.clock import Clock
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.judge import FRAMES, Judgement, Outcome, judge, keep_evidence, median_pose
from taskschema_robot.reward.tracker import ObjectTracker, Sighting

FRAME_SECONDS = 0.04
"""Between looks for a new frame [s]."""
PATIENCE = 6.0
"""How long to wait for enough new frames [s]."""
NEAR = 0.03
"""How near to the wanted place a person has to put the object [m]."""
ALIGNED = np.deg2rad(15.0)
"""How exactly a person has to turn it, and what turns on it [rad]."""
MOST_REQUESTS = 5
KEPT = 10_000
"""Evidence pictures kept; the oldest go."""


class ResetPerson(Protocol):
    """Who puts the object back, and is asked what the camera cannot see."""

    def ask_reset(self, item: RobotObject, wanted: FloatArray, problem: str) -> None:
        """Ask for the object at a pose [7 + h]; return when it is said to be there."""
        ...

    def ask_outcome(self, judgement: Judgement) -> bool | None:
        """Ask what an unknown outcome is; None: nobody knows."""
        ...


class CameraWorld:
    """See `World`. Markers give the reward and check the reset; the policy never sees them.

    Args:
        camera: overhead.
        tracker: of the object.
        task: whose goal decides.
        item: the object.
        person: who puts it back.
        clock: the agent's.
        evidence: folder of the pictures that outcomes were judged by.

    """

    def __init__(
        self,
        camera: Camera,
        tracker: ObjectTracker,
        task: SceneTask,
        item: RobotObject,
        person: ResetPerson,
        clock: Clock,
        evidence: Path,
    ) -> None:
        self._camera, self._tracker, self._task = camera, tracker, task
        self._item, self._person, self._clock = item, person, clock
        self._last_number = self._last_followed = -1
        self._known: FloatArray | None = None
        self._evidence = KeptFiles(evidence, ".png", KEPT)

    def reset(self, instance: ObjectInstance) -> FloatArray:
        """Ask for the object until it is seen where it should be; see `World`."""
        wanted, problem = start_pose(self._item, instance), ""
        for _ in range(MOST_REQUESTS):
            self._person.ask_reset(self._item, wanted, problem)
            self._tracker.reset()
            pose, problem = median_pose(self.look())
            if pose is None:
                continue
            self._known = pose
            problem = self._misplaced(pose, wanted)
            if not problem:
                return pose
        raise EpisodeDroppedError(f"The object is not at its start: {problem}.")

    def _misplaced(self, pose: FloatArray, wanted: FloatArray) -> str:
        """Return what is wrong with how the object stands at the start; empty: nothing."""
        distance = float(np.hypot(*(pose[:2] - wanted[:2])))
        if distance > NEAR:
            return f"it is {100 * distance:.0f} cm from where it should be"
        turned = _wrapped(_heading(pose) - _heading(wanted))
        if self._item.faces and abs(turned) > ALIGNED:
            return f"it is turned by {np.rad2deg(turned):+.0f} degrees from how it should stand"
        angle = _wrapped(self._tracker.first_angle)
        if abs(angle) > ALIGNED:
            return f"its turning part was not turned back: it stands at {np.rad2deg(angle):+.0f} degrees"
        return ""

    def object_pose(self) -> FloatArray | None:
        """Return the pose by markers, the last one known in this episode if hands hide it; see `World`.

        That is for the policy's state and for planning; an outcome is never judged by it.
        """
        pose, _ = median_pose(self.look())
        self._known = self._known if pose is None else pose
        return self._known

    def judge(self, start: FloatArray, name: str) -> Judgement:
        """Judge new frames, and keep the last one; see `World`."""
        return keep_evidence(judge(self._task, start, self.look()), self._evidence, name)

    def ask(self, judgement: Judgement) -> Judgement:
        """Ask the person; see `World`."""
        said = self._person.ask_outcome(judgement)
        if said is None:
            return judgement
        outcome = Outcome.SUCCESS if said else Outcome.FAILURE
        return dataclasses.replace(judgement, outcome=outcome, reason="by a person's word")

    def last_look(self, start: FloatArray, name: str) -> Judgement:
        """Judge with the hands withdrawn, and ask a person what is still unknown; see `World`."""
        judgement = self.judge(start, name)
        return self.ask(judgement) if judgement.outcome is Outcome.UNKNOWN else judgement

    def look(self) -> list[Sighting]:
        """Return what the next frames show, taken from now on; fewer than wanted if no more come."""
        sightings: list[Sighting] = []
        begin = self._clock.now()
        while len(sightings) < FRAMES and self._clock.now() < begin + PATIENCE:
            frame = self._camera.latest()
            if frame.number != self._last_number and frame.time >= begin:
                self._last_number = frame.number
                sightings.append(self._tracker.see(frame))
            self._clock.sleep_until(self._clock.now() + FRAME_SECONDS)
        return sightings

    def follow(self) -> None:
        """Keep track of the object between two looks: which way a hinge turns has to be seen."""
        frame = self._camera.latest()
        if frame.number != self._last_followed:
            self._last_followed = frame.number
            self._tracker.see(frame)


def _heading(pose: FloatArray) -> float:
    """Return the angle of a standing object's x axis to the world's [rad]."""
    x, y, _ = rotate(pose[3:7], np.array([1.0, 0.0, 0.0]))
    return float(np.arctan2(y, x))


def _wrapped(angle: float) -> float:
    """Return the angle within (-pi, pi]."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))
