"""`taskschema replay`: films of episodes."""

from pathlib import Path
from typing import Annotated

import typer

from taskschema_learner.cli.run_reference import find_run

CAMERAS = ("front", "close", "overhead")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(replay)


def replay(
    run: Annotated[
        str | None, typer.Argument(metavar="RUN", help="A run's folder, or its name below runs/.")
    ] = None,
    expert: Annotated[
        str | None, typer.Option(metavar="TASK", help="Show a task's scripted expert instead of a run.")
    ] = None,
    task_file: Annotated[
        str | None,
        typer.Option(metavar="FILE:CLASS", help="Show the scripted expert of a task of your own."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File: .mp4, .gif or .png (the last frame). Default: NAME.mp4."),
    ] = None,
    episodes: Annotated[int, typer.Option(min=1, max=100, help="Episodes to show.")] = 3,
    step: Annotated[
        int | None, typer.Option(min=1, help="Show only this step of every episode, from 1.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Draws the expert's instances.")] = 0,
    sampled: Annotated[
        bool,
        typer.Option("--sampled", help="A run's sampled actions, as in training, instead of its mean ones."),
    ] = False,
    camera: Annotated[
        str, typer.Option(metavar="front|close|overhead", help="Both arms, the hands, or straight down.")
    ] = "front",
    width: Annotated[int, typer.Option(min=64, max=1920, help="Width of the film in pixels.")] = 640,
    height: Annotated[int, typer.Option(min=64, max=1440, help="Height of the film in pixels.")] = 480,
) -> None:
    """Make a film of episodes, with the names of the skills written in.

    Shows a run's newest policy on instances it was not trained on, or how a task is solved: --expert TASK.
    From above, --camera overhead, a run on images shows where each arm would go: left red, right blue.
    """
    from taskschema.errors import ConfigError, UnknownNameError
    from taskschema.tasks.registry import task_of
    from taskschema_learner.cli.task_reference import named_task
    from taskschema_learner.replay.film import frame_rate

    if [run, expert, task_file].count(None) != 2:
        raise ConfigError("Name one of: a RUN; a task, --expert TASK; your own, --task-file FILE:CLASS.")
    if camera not in CAMERAS:
        raise UnknownNameError("camera", camera, CAMERAS)
    if width % 2 or height % 2:
        raise ConfigError(f"A film's width and height are even numbers; got {width} x {height}.")
    folder = None if run is None else find_run(run)
    if folder is not None:
        task, name = task_of(folder.config), folder.name
    else:
        task = named_task(expert, task_file)
        name = f"{task.name}-expert"
    path = output or Path(f"{name}.mp4")
    rate = frame_rate(path)

    from taskschema_learner.replay.film import write_film
    from taskschema_learner.replay.recorded_episodes import (
        expert_episodes,
        response_overlay,
        run_episodes,
        scene_of,
    )
    from taskschema_learner.replay.replay import Look, draw_episodes
    from taskschema_worker.rendering.backend import working_backend

    scene = scene_of(task)
    working_backend()  # says what is missing before anything takes long
    if folder is None:
        shown = expert_episodes(scene, episodes, seed)
        title = f"{task.name.replace('-', ' ')}, scripted expert"
    else:
        shown = run_episodes(folder, episodes, mean=not sampled)
        title = f"{folder.name}, policy version {folder.read_schema().version}"
    look = Look(camera, width, height, step)
    overlay = response_overlay(folder) if folder is not None and camera == "overhead" else None
    write_film(path, draw_episodes(scene, shown, rate, look, title, overlay))
    if overlay is not None:
        overlay.close()
    print(f"{path}: {len(shown)} episodes, {sum(item.success for item in shown)} solved")
