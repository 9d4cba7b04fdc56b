"""`taskschema scale`: change the number of workers while a run trains."""

from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(scale)


def scale(
    workers: Annotated[int, typer.Argument(metavar="N", min=0, help="How many workers there are to be.")],
    run: Annotated[
        str | None, typer.Option(metavar="RUN", help="The run. Default: the one that trains here.")
    ] = None,
    redis: Annotated[
        str | None,
        typer.Option(metavar="URL", envvar="TASKSCHEMA_REDIS_URL", help="The Redis that the run uses."),
    ] = None,
) -> None:
    """Change how many workers a training run has, while it trains; its results stay the same.

    The run starts or stops workers within seconds, as far as its machine or cluster holds them. 0 lets it
    wait without workers.
    """
    from taskschema_learner.cli.running import find_running

    records, name = find_running(run, redis)
    records.set_worker_target(name, workers)
    print(f"{name}: {workers} workers asked for")
