"""Environments of any task."""

import os
from typing import TYPE_CHECKING, cast

from taskschema.config import ObservationKind, RunConfig
from taskschema.errors import ConfigError
from taskschema.tasks.scene_task import SceneTask, with_arms
from taskschema.tasks.task import BatchEnvironment, SeenEnvironment, Task

if TYPE_CHECKING:
    from taskschema_worker.plan_gate import PlanGate


def make_environment(
    task: Task,
    threads: int = 1,
    observation: ObservationKind = "state",
    *,
    randomise_visuals: bool = False,
    safety_gate: bool = False,
) -> BatchEnvironment:
    """Return an environment for many episodes of `task` at once, its physics on `threads` threads.

    Args:
        task: what is done.
        threads: of the simulation.
        observation: what policies see.
        randomise_visuals: of images: whether colours, light and the camera's pose vary by episode.
        safety_gate: whether steps that the robot's gate would refuse are not made.

    Raises:
        ConfigError: for `image`, if nothing shows how the task looks, or its looks cannot vary; for a gate,
            if the task has no arms.
        RenderingError: for `image`, if nothing on this machine can draw.
    """
    gate = _gate_of(task) if safety_gate else None
    if observation == "image":
        return _image_environment(task, threads, randomise_visuals, gate)
    if isinstance(task, SceneTask):
        from taskschema_worker.scene_environment import SceneEnvironment

        return SceneEnvironment(task, threads, gate=gate)
    return task.make_environment(threads)


def spare_graphics(config: RunConfig) -> None:
    """Keep MuJoCo from importing what it draws with, in a process that only runs episodes of this run.

    That is 2 MB of each process's own memory; to be called before anything imports MuJoCo.
    """
    if config.observation == "state":
        os.environ.setdefault("MUJOCO_GL", "disable")


def environment_of(config: RunConfig, task: Task, threads: int = 1) -> BatchEnvironment:
    """Return the environment of a run's episodes; see `make_environment`."""
    return make_environment(
        task,
        threads,
        config.observation,
        randomise_visuals=config.image.randomise_visuals,
        safety_gate=config.safety_gate,
    )


def _gate_of(task: Task) -> "PlanGate":
    from taskschema_worker.plan_gate import PlanGate

    return PlanGate(with_arms(task))


def _image_environment(
    task: Task, threads: int, randomise_visuals: bool, gate: "PlanGate | None"
) -> BatchEnvironment:
    from taskschema_worker.image_environment import ImageEnvironment

    if isinstance(task, SceneTask):
        from taskschema_worker.seen_scene_environment import SeenSceneEnvironment

        seen = SeenSceneEnvironment(task, threads, randomise_visuals=randomise_visuals, gate=gate)
        return ImageEnvironment(task, seen)
    if randomise_visuals:
        raise ConfigError(f"Task {task.name!r} has no scene, so --randomise-visuals cannot vary its looks.")
    environment = task.make_environment(threads)
    if not hasattr(environment, "frames"):
        environment.close()
        raise ConfigError(f"Task {task.name!r} has no pictures: use --observation state.")
    return ImageEnvironment(task, cast(SeenEnvironment, environment))
