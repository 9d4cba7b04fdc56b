"""Environments of any task."""

from typing import cast

from taskschema.config import ObservationKind, RunConfig
from taskschema.errors import ConfigError
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.task import BatchEnvironment, SeenEnvironment, Task


def make_environment(
    task: Task,
    threads: int = 1,
    observation: ObservationKind = "state",
    *,
    randomise_visuals: bool = False,
) -> BatchEnvironment:
    """Return an environment for many episodes of `task` at once, its physics on `threads` threads.

    Args:
        task: what is done.
        threads: of the simulation.
        observation: what policies see.
        randomise_visuals: of images: whether colours, light and the camera's pose vary by episode.

    Raises:
        ConfigError: for `image`, if nothing shows how the task looks, or its looks cannot vary.
        RenderingError: for `image`, if nothing on this machine can draw.
    """
    if observation == "image":
        return _image_environment(task, threads, randomise_visuals)
    if isinstance(task, SceneTask):
        from taskschema_worker.scene_environment import SceneEnvironment

        return SceneEnvironment(task, threads)
    return task.make_environment(threads)


def environment_of(config: RunConfig, task: Task, threads: int = 1) -> BatchEnvironment:
    """Return the environment of a run's episodes; see `make_environment`."""
    visuals = config.image.randomise_visuals
    return make_environment(task, threads, config.observation, randomise_visuals=visuals)


def _image_environment(task: Task, threads: int, randomise_visuals: bool) -> BatchEnvironment:
    from taskschema_worker.image_environment import ImageEnvironment

    if isinstance(task, SceneTask):
        from taskschema_worker.seen_scene_environment import SeenSceneEnvironment

        seen = SeenSceneEnvironment(task, threads, randomise_visuals=randomise_visuals)
        return ImageEnvironment(task, seen)
    if randomise_visuals:
        raise ConfigError(f"Task {task.name!r} has no scene, so --randomise-visuals cannot vary its looks.")
    environment = task.make_environment(threads)
    if not hasattr(environment, "frames"):
        environment.close()
        raise ConfigError(f"Task {task.name!r} has no pictures: use --observation state.")
    return ImageEnvironment(task, cast(SeenEnvironment, environment))
