"""`taskschema eval`, `verify` and `export`: running a trained policy, or a whole run, again."""

from pathlib import Path
from typing import Annotated

import typer

from taskschema_learner.cli.output import Json, RunReference, print_json
from taskschema_learner.cli.run_reference import find_run


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("eval")(evaluate)
    app.command()(verify)
    app.command()(export)


def evaluate(
    run: RunReference,
    episodes: Annotated[int, typer.Option(min=1, help="Held-out episodes of each kind.")] = 200,
    as_json: Json = False,
) -> None:
    """Measure a trained policy on instances it was not trained on, with sampled and with mean actions."""
    from taskschema_learner import evaluation

    found = evaluation.evaluate(find_run(run), episodes)
    if as_json:
        print_json(found)
        return
    print(f"{found.run}, policy version {found.policy_version}, on {episodes} held-out instances:")
    for kind, rate in (("sampled actions", found.sampled), ("mean actions", found.mean)):
        interval = f"95 % confidence interval {rate.low:.1%} to {rate.high:.1%}"
        print(f"  {kind:16} {rate.rate:6.1%} success ({interval})")


def verify(
    run: RunReference,
    rounds: Annotated[
        int | None, typer.Option(min=1, help="Compare only the first rounds. Default: all.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Compute a run again from its config and seed and compare the policies' hashes round by round.

    Takes about as long as the training did with as many workers as there are cores. The exit status is 1
    if a round differs. A robot's run cannot be computed again.
    """
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress

    from taskschema_learner.runs import verification

    folder = find_run(run)
    columns = (*Progress.get_default_columns(), MofNCompleteColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("rounds", total=None)
        found = verification.verify(
            folder, rounds, lambda done, total: bar.update(task, completed=done, total=total)
        )
    if as_json:
        print_json(found)
    elif found.same:
        print(f"The same: {found.rounds} rounds of {found.run}, each with the recorded hash.")
        print(found.computed_sha256)
    else:
        print(
            f"Round {found.first_difference} of {found.run} differs: recorded {found.recorded_sha256}, "
            f"computed {found.computed_sha256}. {verification.SAME_BITS}"
        )
    if not found.same:
        raise typer.Exit(1)


def export(
    run: RunReference,
    output: Annotated[Path, typer.Argument(metavar="FILE", help="File to write: .npz or .jsonl.")],
    episodes: Annotated[int, typer.Option(min=1, help="Held-out episodes to export.")] = 200,
    mean: Annotated[bool, typer.Option("--mean", help="Mean actions instead of sampled ones.")] = False,
    rounds: Annotated[
        int | None,
        typer.Option(min=1, help="Export the training episodes of the first rounds instead, at most all."),
    ] = None,
) -> None:
    """Write trajectories to a file for analysis.

    A run does not keep its trajectories. By default the newest policy is run on held-out instances; with
    --rounds the run's training is computed again from its config and seed, which gives the very episodes
    that it was trained on: hashes are compared. A robot's run cannot be computed again.
    """
    from taskschema.tasks.registry import task_of
    from taskschema_learner.runs.export import require_format, write_trajectories

    require_format(output)
    folder = find_run(run)
    if rounds is None:
        from taskschema_learner.evaluation import held_out_episodes
        from taskschema_learner.runs.run_policies import newest_policy

        trajectories = held_out_episodes(folder, newest_policy(folder), episodes, mean=mean)
        source = "held-out episodes of the newest policy"
    else:
        from taskschema_learner.runs.verification import training_episodes

        trajectories = training_episodes(folder, rounds)
        done = trajectories[-1].round + 1
        source = f"training episodes of the first {done} rounds, computed again"
    write_trajectories(output, task_of(folder.config), trajectories, folder.config.observation)
    print(f"{output}: {len(trajectories)} {source}")
