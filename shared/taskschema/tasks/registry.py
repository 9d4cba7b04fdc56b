"""All tasks by name, and the loading of users' own task files."""

import importlib
from pathlib import Path
from types import ModuleType

from taskschema.config import RunConfig
from taskschema.errors import TaskFileError, UnknownNameError
from taskschema.skills.registry import SKILLS
from taskschema.tasks.task import Task

_TASKS: dict[str, tuple[str, str]] = {
    "lateral-lifting": ("taskschema.tasks.lateral_lifting", "LateralLifting"),
    "picking": ("taskschema.tasks.picking", "Picking"),
    "opening": ("taskschema.tasks.opening", "Opening"),
    "rotating": ("taskschema.tasks.rotating", "Rotating"),
    "toy": ("taskschema.tasks.toy", "Toy"),
}
"""Module and class of each task; imported only when asked for."""


def task_names() -> list[str]:
    """Return the registered names, in the order of the paper's Table I."""
    return list(_TASKS)


def get_task(name: str) -> Task:
    """Return a registered task.

    Raises:
        UnknownNameError: if there is none of this name.
        TaskFileError: if it has a skill that its family does not allow.
    """
    if name not in _TASKS:
        raise UnknownNameError("task", name, _TASKS)
    module, class_name = _TASKS[name]
    task: Task = getattr(importlib.import_module(module), class_name)()
    _check_skills(task)
    return task


def read_task_file(reference: str) -> tuple[str, str]:
    """Return (class name, source text) of a `FILE:CLASS` reference.

    Raises:
        TaskFileError: if the reference has no class or the file cannot be read.
    """
    path, separator, class_name = reference.rpartition(":")
    if not separator or not class_name.isidentifier():
        raise TaskFileError(f"--task-file takes FILE:CLASS, such as my_task.py:MyTask; got {reference!r}.")
    try:
        return class_name, Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TaskFileError(f"Task file {path!r} cannot be read: {error}.") from None


def load_task_source(class_name: str, source: str) -> Task:
    """Run a task file's source, which its user trusts as any program of theirs, and make its task.

    Raises:
        TaskFileError: if it does not run, has no such class, the class is no complete `Task`, or has a skill
            that its family does not allow.
    """
    module = ModuleType("taskschema_user_task")
    try:
        exec(compile(source, f"<task file of {class_name}>", "exec"), module.__dict__)
    except Exception as error:  # whatever a user's file raises is theirs to see, on one line
        raise TaskFileError(f"The task file fails: {type(error).__name__}: {error}.") from error
    candidate = getattr(module, class_name, None)
    if not (isinstance(candidate, type) and issubclass(candidate, Task)):
        classes = [
            name
            for name, value in vars(module).items()
            if isinstance(value, type) and issubclass(value, Task) and value is not Task
        ]
        raise TaskFileError(
            f"The task file has no Task class {class_name!r}; it has: {', '.join(classes) or 'none'}."
        )
    try:
        task = candidate()
        _check_skills(task)
    except (TypeError, AttributeError) as error:
        raise TaskFileError(f"Task class {class_name!r} is not complete: {error}.") from None
    return task


def _check_skills(task: Task) -> None:
    """Refuse a skill that the task's family does not allow.

    Raises:
        TaskFileError: that names those it does.
    """
    skills = {skill.name: skill for skill in (*SKILLS.values(), *task.pairs.skills)}
    for skill in task.pairs.skills:
        if not skill.is_allowed_in(task.family):
            allowed = sorted(name for name, other in skills.items() if other.is_allowed_in(task.family))
            raise TaskFileError(
                f"Task {task.name!r} has the skill {skill.name!r}, which is for {', '.join(skill.families)}, "
                f"but its own family {task.family!r} allows: {', '.join(allowed)}."
            )


def task_of(config: RunConfig) -> Task:
    """Return the task that a run is about."""
    if config.task_source is not None:
        return load_task_source(config.task, config.task_source)
    return get_task(config.task)
