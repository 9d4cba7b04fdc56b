"""Rollout workers: scenes, simulation, gymnasium environments and the rollout loop.

Importing this package registers every task with gymnasium where that is installed, and imports no simulator.
Rollout actors, of which there may be fifty on a machine, do without: it takes 3 MB and a quarter of a second.
"""

import os
from importlib.util import find_spec

from taskschema.tasks.registry import task_names

WITHOUT_GYMNASIUM = "TASKSCHEMA_WITHOUT_GYMNASIUM"
"""Environment variable of processes that need no gymnasium environments."""


def _register_environments() -> None:
    """Register `taskschema/LateralLifting-v0` and so on, one for every task."""
    import gymnasium

    for name in task_names():
        title = "".join(word.capitalize() for word in name.split("-"))
        gymnasium.register(
            id=f"taskschema/{title}-v0",
            entry_point="taskschema_worker.gymnasium_environment:TaskEnvironment",
            vector_entry_point="taskschema_worker.gymnasium_vector:TaskVectorEnvironment",
            kwargs={"task": name},
        )


if WITHOUT_GYMNASIUM not in os.environ and find_spec("gymnasium") is not None:
    _register_environments()
