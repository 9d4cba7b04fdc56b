"""The episodes that a film shows."""

import os
from contextlib import closing

from taskschema.errors import RenderingError
from taskschema.policies import ImagePolicy, policy_of
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.registry import task_of
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.task import BatchEnvironment, Task
from taskschema_learner.evaluation import held_out_episodes
from taskschema_learner.replay.response_overlay import ResponseOverlay
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import newest_policy
from taskschema_worker.audit.episodes import expert, run_schema
from taskschema_worker.image_environment import ImageEnvironment
from taskschema_worker.plan_gate import PlanGate
from taskschema_worker.recording import RecordedEpisode, RecordingEnvironment, SeenRecordingEnvironment


def scene_of(task: Task) -> SceneTask:
    """Return the task, if it has a scene.

    Raises:
        RenderingError: if it has none.

    """
    if not isinstance(task, SceneTask):
        raise RenderingError(f"Task {task.name!r} has no scene: there is nothing to see.")
    return task


def expert_episodes(task: SceneTask, count: int, seed: int) -> list[RecordedEpisode]:
    """Run the task's scripted expert under the paper's schema on `count` instances drawn from `seed`."""
    draws = [generator(EpisodeKey(seed, 0, 0, episode), Purpose.RESET) for episode in range(count)]
    with closing(RecordingEnvironment(task, threads=os.cpu_count() or 1)) as environment:
        instances = [task.draw_instance(draw) for draw in draws]
        run_schema(environment, task, task.paper_schema, instances, expert(task))
    return environment.episodes


def run_episodes(folder: RunFolder, count: int, *, mean: bool) -> list[RecordedEpisode]:
    """Run a run's newest policy on its first held-out instances, with mean or with sampled actions.

    Raises:
        TaskschemaError: if the run has no policy yet, or its task no scene.

    """
    task = scene_of(task_of(folder.config))
    threads = os.cpu_count() or 1
    visuals = folder.config.image.randomise_visuals
    gate = PlanGate(task) if folder.config.safety_gate else None
    recording: RecordingEnvironment
    environment: BatchEnvironment
    if folder.config.observation == "image":
        recording = SeenRecordingEnvironment(task, threads, randomise_visuals=visuals, gate=gate)
        environment = ImageEnvironment(task, recording)
    else:
        environment = recording = RecordingEnvironment(task, threads, gate=gate)
    held_out_episodes(folder, newest_policy(folder), count, mean=mean, environment=environment)
    return recording.episodes


def response_overlay(folder: RunFolder) -> ResponseOverlay | None:
    """Return what lays the newest policy's response maps over overhead pictures; None: it sees states.

    Raises:
        TaskschemaError: if the run has no policy yet, its task no scene, or nothing here can draw.

    """
    task = scene_of(task_of(folder.config))
    policy = policy_of(folder.config, task, newest_policy(folder))
    return ResponseOverlay(task, policy) if isinstance(policy, ImagePolicy) else None
