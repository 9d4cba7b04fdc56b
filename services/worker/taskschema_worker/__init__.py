"""Rollout workers: scenes, simulation, gymnasium environments and the rollout loop.

Importing this package registers every task with gymnasium where that is installed, and imports no simulator.
"""

from importlib.util import find_spec

from taskschema.tasks.registry import task_names


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


if find_spec("gymnasium") is not None:  # workers do without
    _register_environments()
