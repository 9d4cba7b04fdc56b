"""The tasks: families, objects, randomisation and goals (paper, Table I)."""

from taskschema.tasks.registry import get_task, load_task_source, read_task_file, task_names
from taskschema.tasks.task import BatchEnvironment, Schema, StepResult, Task

__all__ = [
    "BatchEnvironment",
    "Schema",
    "StepResult",
    "Task",
    "get_task",
    "load_task_source",
    "read_task_file",
    "task_names",
]
