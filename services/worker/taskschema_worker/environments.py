"""Environments of any task."""

from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.task import BatchEnvironment, Task


def make_environment(task: Task, threads: int = 1) -> BatchEnvironment:
    """Return an environment for many episodes of `task` at once, its physics on `threads` threads."""
    if isinstance(task, SceneTask):
        from taskschema_worker.scene_environment import SceneEnvironment

        return SceneEnvironment(task, threads)
    return task.make_environment(threads)
