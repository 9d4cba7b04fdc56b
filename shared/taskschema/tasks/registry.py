"""All tasks by name, and the loading of users' own task files."""

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from taskschema.config import RunConfig
from taskschema.errors import TaskFileError, UnknownNameError
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.skills.skill import Skill
from taskschema.tasks.task import Task
from taskschema.tasks.user_code import user_code

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


def load_task_source(class_name: str, source: str, path: str | None = None) -> Task:
    """Run a task file's source, which its user trusts as any program of theirs, and make its task.

    Args:
        class_name: of the task.
        source: text of the file.
        path: of the file, for what is said about errors; None: not known, as to workers.

    Raises:
        TaskFileError: if it does not run, has no such class, the class is no complete `Task`, or has a skill
            that its family does not allow; the message says where.
    """
    file = task_file_name(class_name, path)
    module = ModuleType("taskschema_user_task")
    sys.modules[module.__name__] = module  # where dataclasses look up the names in their annotations
    with user_code(file):
        exec(compile(source, file, "exec", dont_inherit=True), module.__dict__)
        task_class = _task_class(module, class_name)
        task = task_class()
        _require_members(task)
        _check_skills(task)
    return task


def task_file_name(class_name: str, path: str | None) -> str:
    """Return what a task file is called in messages: its path, if that is known."""
    return f"<task file of {class_name}>" if path is None else path


def _task_class(module: ModuleType, name: str) -> type[Task]:
    """Return the task class called `name`.

    Raises:
        TaskFileError: if there is none; the message lists the file's own. Or if it lacks methods.
    """
    candidate = getattr(module, name, None)
    if not (isinstance(candidate, type) and issubclass(candidate, Task)):
        classes = [
            name
            for name, value in vars(module).items()
            if isinstance(value, type) and issubclass(value, Task) and value.__module__ == module.__name__
        ]
        raise TaskFileError(f"There is no Task class {name!r}; there is: {', '.join(classes) or 'none'}.")
    if lacking := sorted(candidate.__abstractmethods__):
        raise TaskFileError(_lacks(candidate, lacking))
    return candidate


def _require_members(task: Task) -> None:
    """Refuse a task that does not say what it is.

    Raises:
        TaskFileError: that names what it lacks.
    """
    names = ("name", "family", "summary", "paper_schema")
    if lacking := [name for name in names if not hasattr(task, name)]:
        raise TaskFileError(_lacks(type(task), lacking))


def _lacks(task_class: type[Task], members: Sequence[str]) -> str:
    return (
        f"Task class {task_class.__name__!r} is not complete, it lacks: {', '.join(members)}; "
        "docs/add-a-task.md says what they are."
    )


def _check_skills(task: Task) -> None:
    """Refuse skills that are none, and one that the task's family does not allow.

    Raises:
        TaskFileError: that names those it does.
    """
    pairs = task.pairs
    if not (isinstance(pairs, PairSpace) and pairs.skills):
        raise TaskFileError(f"pairs must be a PairSpace of skills, got {pairs!r:.80}.")
    for skill in pairs.skills:
        if not isinstance(skill, Skill):
            raise TaskFileError(f"pairs must be of skills such as Lift(), got {skill!r:.80}.")
    skills = {skill.name: skill for skill in (*SKILLS.values(), *pairs.skills)}
    for skill in pairs.skills:
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
