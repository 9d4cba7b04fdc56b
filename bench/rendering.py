"""Row 14: the overhead frame that a policy sees: how long it takes, and what the arms hide in it."""

import time
from statistics import median

from bench.entry import Entry
from taskschema.frames import FRAME_SIZE
from taskschema.tasks.registry import get_task, task_names
from taskschema.tasks.scene_task import SceneTask
from taskschema_learner.replay.recorded_episodes import expert_episodes
from taskschema_worker.recording import RecordedEpisode
from taskschema_worker.rendering.scene_renderer import SceneRenderer
from taskschema_worker.rendering.speed import milliseconds_per_frame

TARGET_MS = 15.0
EPISODES = 20


def measure(repeats: int, episodes: int = EPISODES) -> list[Entry]:
    scenes = [task for task in map(get_task, task_names()) if isinstance(task, SceneTask)]
    entries = []
    for task in scenes:
        # Processor time of all of the renderer's threads: at least the wall time of a machine left alone.
        times = [median(milliseconds_per_frame(task, clock=time.process_time)) for _ in range(repeats)]
        entries.append(
            Entry.of(14, f"{task.name}: an overhead frame, processor time", times, "ms", TARGET_MS, "lower")
        )
    for task in scenes:
        entries += _visibility(task, episodes)
    return entries


def _visibility(task: SceneTask, episodes: int) -> list[Entry]:
    """Return the share of the object that is seen when each step of the expert is decided."""
    shown = expert_episodes(task, episodes, seed=0)
    with SceneRenderer(task, FRAME_SIZE, FRAME_SIZE) as renderer:
        shares = [_shares(renderer, episode) for episode in shown]
    steps = range(max(map(len, shares)))
    return [
        Entry.of(
            14,
            f"{task.name}: share of the object seen at the decision of step {step + 1}",
            [episode[step] for episode in shares if len(episode) > step],
            "",
            None,
            "higher",
        )
        for step in steps
    ]


def _shares(renderer: SceneRenderer, episode: RecordedEpisode) -> list[float]:
    renderer.set_object(episode.instance)
    state, shares = episode.start, []
    for step in episode.steps:
        shares.append(renderer.object_pixels(state) / renderer.object_pixels(state, arms=False))
        state = step.positions[-1] if step.positions else state
    return shares
