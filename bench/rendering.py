"""Row 14: the overhead frame that a policy sees: how long it takes, and what the arms hide in it.

The row's episodes are those of the scripted expert under the paper's schema. `python -m bench.rendering RUN`
counts what the arms hide in episodes of a run's own policy, under the schema that it learned or was given.
"""

import argparse
import time
from pathlib import Path
from statistics import median

from bench.entry import Entry, table
from taskschema.frames import FRAME_SIZE
from taskschema.tasks.registry import get_task, task_names, task_of
from taskschema.tasks.scene_task import SceneTask
from taskschema_learner.replay.recorded_episodes import expert_episodes, run_episodes, scene_of
from taskschema_learner.runs.run_folder import RunFolder
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
        entries += visibility(task, task.name, expert_episodes(task, episodes, seed=0))
    return entries


def visibility(task: SceneTask, name: str, shown: list[RecordedEpisode]) -> list[Entry]:
    """Return the share of the object that is seen when each step of some episodes is decided."""
    with SceneRenderer(task, FRAME_SIZE, FRAME_SIZE) as renderer:
        shares = [_shares(renderer, episode) for episode in shown]
    return [
        Entry.of(
            14,
            f"{name}: share of the object seen at the decision of step {step + 1}",
            [episode[step] for episode in shares if len(episode) > step],
            "",
            None,
            "higher",
        )
        for step in range(max(map(len, shares)))
    ]


def _shares(renderer: SceneRenderer, episode: RecordedEpisode) -> list[float]:
    renderer.set_object(episode.instance)
    state, shares = episode.start, []
    for step in episode.steps:
        shares.append(renderer.object_pixels(state) / renderer.object_pixels(state, arms=False))
        state = step.positions[-1] if step.positions else state
    return shares


def main() -> None:
    """Print what the arms hide in the first held-out instances of a run, as its mean actions decide."""
    parser = argparse.ArgumentParser(prog="python -m bench.rendering", description=__doc__)
    parser.add_argument("run", type=Path, help="the run's folder")
    folder = RunFolder.open(parser.parse_args().run)
    shown = run_episodes(folder, EPISODES, mean=True)
    longest = max(shown, key=lambda episode: len(episode.steps))
    print(", ".join(f"({step.left}, {step.right})" for step in longest.steps), "\n")
    print(table(visibility(scene_of(task_of(folder.config)), folder.name, shown)))


if __name__ == "__main__":
    main()
