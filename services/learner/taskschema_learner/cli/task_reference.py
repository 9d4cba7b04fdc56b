"""The task that a command is about: a registered TASK, or one of the user's own."""

from importlib.util import find_spec

from taskschema.errors import ConfigError
from taskschema.tasks.registry import get_task, load_task_source, read_task_file
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.task import Task
from taskschema.tasks.task_check import check_expert, check_task
from taskschema.tasks.user_code import user_code


def task_and_source(task: str | None, task_file: str | None) -> tuple[str, str | None]:
    """Return the task's name, and the source text of a `FILE:CLASS`; None for a registered task.

    Raises:
        ConfigError: unless exactly one of both is given; TaskFileError: if the file cannot be read.
    """
    if task_file is None and task is not None:
        return task, None
    if task_file is not None and task is None:
        return read_task_file(task_file)
    raise ConfigError("Name a TASK (see `taskschema tasks`) or give --task-file FILE:CLASS, one of both.")


def named_task(task: str | None, task_file: str | None) -> Task:
    """Return the task itself, whose scripted expert is to run here.

    Raises:
        TaskschemaError: as `task_and_source` and `own_task`, or if there is no such task.
    """
    name, _ = task_and_source(task, task_file)
    if task_file is None:
        return get_task(name)
    own = own_task(task_file)
    if isinstance(own, SceneTask):
        check_expert(own, _path(task_file))
    return own


def own_task(task_file: str, *, runs_here: bool = True) -> Task:
    """Return the task of a `FILE:CLASS`, each of its members used once.

    Args:
        task_file: `FILE:CLASS`.
        runs_here: whether its episodes do; elsewhere they may need what is not installed here.

    Raises:
        TaskFileError: if it does not load, or is not fit for a run.
    """
    class_name, source = read_task_file(task_file)
    path = _path(task_file)
    task = load_task_source(class_name, source, path)
    check_task(task, path, runs_here=runs_here)
    if isinstance(task, SceneTask) and find_spec("mujoco") is not None:
        from taskschema_worker.scenes import scene_model

        with user_code(path):
            scene_model(task)
    return task


def _path(task_file: str) -> str:
    return task_file.rpartition(":")[0]
