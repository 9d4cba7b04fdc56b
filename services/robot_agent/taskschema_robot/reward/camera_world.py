"""The object as the overhead camera sees it, put back by a person."""

from pathlib import Path
from typing import Protocol

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema_robot.agent.start_pose import start_pose
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.camera.camera import Camera
from taskschema_robot.clock import Clock
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.judge import FRAMES, Judgement, Outcome, judge, keep_evidence, median_pose
from taskschema_robot.reward.tracker import ObjectTracker, Sighting

FRAME_SECONDS = 0.04
"""Between looks for a new frame [s]."""
PATIENCE = 3.0
"""How long to wait for enough new frames [s]."""
NEAR = 0.03
"""How near to the wanted place a person has to put the object [m]."""
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
        self._last_number = -1
        self._known: FloatArray | None = None
        self._evidence, self._judged = evidence, 0

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
            distance = float(np.hypot(*(pose[:2] - wanted[:2])))
            if distance <= NEAR:
                return pose
            problem = f"it is {100 * distance:.0f} cm from where it should be"
        raise EpisodeDroppedError(f"The object is not at its start: {problem}.")

    def object_pose(self) -> FloatArray | None:
        """Return the pose by markers, the last one known in this episode if hands hide it; see `World`.

        That is for the policy's state and for planning; an outcome is never judged by it.
        """
        pose, _ = median_pose(self.look())
        self._known = self._known if pose is None else pose
        return self._known

    def judge(self, start: FloatArray) -> Judgement:
        """Judge new frames; see `World`."""
        judgement = judge(self._task, start, self.look())
        keep_evidence(judgement, self._evidence / f"{self._judged % KEPT:05d}-{judgement.outcome}.png")
        self._judged += 1
        return judgement

    def last_look(self, start: FloatArray) -> Judgement:
        """Judge with the hands withdrawn, and ask a person what is still unknown; see `World`."""
        judgement = self.judge(start)
        if judgement.outcome is not Outcome.UNKNOWN:
            return judgement
        said = self._person.ask_outcome(judgement)
        if said is None:
            return judgement
        outcome = Outcome.SUCCESS if said else Outcome.FAILURE
        return Judgement(outcome, "by a person's word", judgement.pose, judgement.evidence)

    def look(self) -> list[Sighting]:
        """Return what the next frames show; fewer than wanted if the camera gives no more."""
        sightings: list[Sighting] = []
        deadline = self._clock.now() + PATIENCE
        while len(sightings) < FRAMES and self._clock.now() < deadline:
            frame = self._camera.latest()
            if frame.number != self._last_number:
                self._last_number = frame.number
                sightings.append(self._tracker.see(frame))
            self._clock.sleep_until(self._clock.now() + FRAME_SECONDS)
        return sightings
