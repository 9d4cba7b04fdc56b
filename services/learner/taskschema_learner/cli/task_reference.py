"""The task that a command is about: a registered TASK, or one of the user's own."""

from taskschema.errors import ConfigError
from taskschema.tasks.registry import get_task, load_task_source, read_task_file
from taskschema.tasks.task import Task


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
    """Return the task itself.

    Raises:
        TaskschemaError: as `task_and_source`, if there is no such task, or if its file does not load.
    """
    name, source = task_and_source(task, task_file)
    return get_task(name) if source is None else load_task_source(name, source)
