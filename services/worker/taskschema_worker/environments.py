"""Environments of any task."""

from typing import cast

from taskschema.config import ObservationKind
from taskschema.errors import ConfigError
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.task import BatchEnvironment, SeenEnvironment, Task


def make_environment(
    task: Task, threads: int = 1, observation: ObservationKind = "state"
) -> BatchEnvironment:
    """Return an environment for many episodes of `task` at once, its physics on `threads` threads.

    Raises:
        ConfigError: for `image`, if nothing shows how the task looks.
        RenderingError: for `image`, if nothing on this machine can draw.
    """
    if observation == "image":
        return _image_environment(task, threads)
    if isinstance(task, SceneTask):
        from taskschema_worker.scene_environment import SceneEnvironment

        return SceneEnvironment(task, threads)
    return task.make_environment(threads)


def _image_environment(task: Task, threads: int) -> BatchEnvironment:
    from taskschema_worker.image_environment import ImageEnvironment

    if isinstance(task, SceneTask):
        from taskschema_worker.seen_scene_environment import SeenSceneEnvironment

        return ImageEnvironment(task, SeenSceneEnvironment(task, threads))
    environment = task.make_environment(threads)
    if not hasattr(environment, "frames"):
        environment.close()
        raise ConfigError(f"Task {task.name!r} has no pictures: use --observation state.")
    return ImageEnvironment(task, cast(SeenEnvironment, environment))
