"""Both arms' response maps, laid over the overhead camera's picture of the table."""

import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.frames import FRAME_SIZE
from taskschema.policies import ImagePolicy
from taskschema.policies.spatial_layout import GRID
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema_worker.rendering.frame import Frame
from taskschema_worker.rendering.scene_renderer import SceneRenderer

COLOURS = np.array([[220.0, 40.0, 40.0], [30.0, 90.0, 230.0]])
"""Of the left and the right arm."""
STRONGEST = 0.6
"""How much of the picture the likeliest cell hides, if no others are likely; an even map hides nothing."""


class ResponseOverlay:
    """What a policy on images would do with both arms, cell by cell; close it, on the thread that made it.

    Args:
        task: whose scene it is.
        policy: whose maps are shown.

    Raises:
        RenderingError: if nothing on this machine can draw.

    """

    def __init__(self, task: SceneTask, policy: ImagePolicy) -> None:
        self._task = task
        self._policy = policy
        self._camera = SceneRenderer(task, FRAME_SIZE, FRAME_SIZE)
        self._maps: FloatArray = np.zeros((2, GRID, GRID))

    def look_at(self, instance: ObjectInstance, positions: AnyArray) -> None:
        """Show from now on what the policy answers to the frame of this state, given as `qpos` [nq]."""
        self._camera.set_object(instance)
        self._maps = self._policy.response_maps(self._camera.render(positions)[None])[0]

    def tint(self, picture: Frame) -> Frame:
        """Return the overhead camera's picture [H, W, 3] with the maps laid over the table."""
        return tinted(picture, self._maps, self._task)

    def close(self) -> None:
        """Give the camera back."""
        self._camera.close()


def tinted(picture: Frame, maps: FloatArray, task: SceneTask) -> Frame:
    """Return a picture [H, W, 3], as high as the camera's view, with two maps [2, 8, 8] laid over it."""
    height, width = picture.shape[:2]
    metres_per_pixel = task.table_view / height
    x = (np.arange(width) + 0.5 - 0.5 * width) * metres_per_pixel
    y = (0.5 * height - np.arange(height) - 0.5) * metres_per_pixel
    (left, right), (lower, upper) = task.table.x, task.table.y
    columns = np.floor((x - left) / (right - left) * GRID).astype(np.int64)
    rows = np.floor((upper - y) / (upper - lower) * GRID).astype(np.int64)
    inside = np.ix_((rows >= 0) & (rows < GRID), (columns >= 0) & (columns < GRID))
    cells = np.ix_(rows[(rows >= 0) & (rows < GRID)], columns[(columns >= 0) & (columns < GRID)])
    result = picture.astype(np.float64)
    for response, colour in zip(maps, COLOURS, strict=True):
        share = (response - response.min()) / response.max()
        weight = STRONGEST * share[cells][..., None]
        result[inside] = (1.0 - weight) * result[inside] + weight * colour
    return result.round().astype(np.uint8)
