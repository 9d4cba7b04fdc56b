"""The overhead camera's frame as a policy's only observation."""

from collections.abc import Sequence

import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.errors import FrameError
from taskschema.frames import check_alive, check_colour_order, check_frames
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.table_arguments import offset_arguments
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.camera.camera import Camera, Frame
from taskschema_robot.camera.table_view import TableView
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmState

PATIENCE = 3.0
"""How long to wait for a picture that was taken after the arms came to rest [s]."""
POLL_SECONDS = 0.02


class FrameObserver:
    """Frames [1, 256, 256, 3], looked at once the arms rest; see `Observer`.

    The object's pose enters no decision: it turns the places on the table that a policy names into offsets
    from the object, which skills are planned from, and so drops out again.

    Args:
        task: of the run.
        size: [3] of the object [m].
        camera: overhead.
        view: cuts the frame out of its picture.
        clock: the agent's.

    """

    def __init__(
        self, task: SceneTask, size: FloatArray, camera: Camera, view: TableView, clock: Clock
    ) -> None:
        self._task = task
        self._anchor_height = task.pose_height * float(size[2])
        self._camera, self._view, self._clock = camera, view, clock
        self._first: AnyArray | None = None
        self._begins = True

    def begin(self) -> None:
        """Expect another picture than the last episode began with; see `Observer`."""
        self._begins = True

    def observe(self, states: Sequence[ArmState], pose: FloatArray, step: int) -> AnyArray:
        """Return the frame [1, 256, 256, 3]; see `Observer`."""
        frames = self._view.frame(self._next_picture().image)[None]
        try:
            check_frames(frames)
            check_colour_order(frames)
            if self._begins and self._first is not None:
                check_alive(np.concatenate([self._first, frames]))
        except FrameError as error:
            raise EpisodeDroppedError(f"No frame for the policy: {error}.") from None
        if self._begins:
            self._first, self._begins = frames, False
        return frames

    def skill_arguments(self, arguments: FloatArray, pose: FloatArray) -> FloatArray:
        """Return offsets from the object of places on the table; see `Observer`."""
        anchor = np.array([[pose[0], pose[1], self._anchor_height]])
        offsets: FloatArray = offset_arguments(self._task, arguments[None], anchor)[0]
        return offsets

    def _next_picture(self) -> Frame:
        """Return a picture that was taken from now on."""
        rest = self._clock.now()
        while (picture := self._camera.latest()).time < rest:
            if self._clock.now() > rest + PATIENCE:
                raise EpisodeDroppedError("No frame for the policy: the camera takes no new picture.")
            self._clock.sleep_until(self._clock.now() + POLL_SECONDS)
        return picture
