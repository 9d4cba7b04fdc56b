"""`taskschema serve`: the HTTP API over a run's folder."""

from typing import Annotated

import typer

from taskschema_learner.cli.output import RunReference
from taskschema_learner.cli.run_reference import find_run


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(serve)


def serve(
    run: RunReference,
    api: Annotated[
        str, typer.Option("--api", metavar="HOST:PORT", help="Where to listen; port 0: any free one.")
    ] = "127.0.0.1:8420",
) -> None:
    """Serve a finished run over HTTP: its schema, its policy, its curve, and actions for observations.

    Stop it with Ctrl-C. Beyond this machine every request needs the token that is printed at the start,
    or that TASKSCHEMA_API_TOKEN sets.
    """
    from taskschema_learner.api import command
    from taskschema_learner.api.address import Address

    folder = find_run(run)
    address = Address.parse(api)
    options = ["--folder", str(folder.path), "--host", address.host, "--port", str(address.port)]
    raise typer.Exit(command.main(options))
