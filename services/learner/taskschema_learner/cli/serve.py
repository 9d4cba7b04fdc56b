"""`taskschema serve`: the HTTP API over a run's folder."""

import os
from typing import Annotated

import typer

from taskschema_learner.cli.output import RunReference
from taskschema_learner.cli.run_reference import find_run, run_name
from taskschema_learner.cli.train_options import ApiTlsCert, ApiTlsKey


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(serve)


def serve(
    run: RunReference,
    api: Annotated[
        str, typer.Option("--api", metavar="HOST:PORT", help="Where to listen; port 0: any free one.")
    ] = "127.0.0.1:8420",
    redis: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            envvar="TASKSCHEMA_REDIS_URL",
            help="Serve the run from this Redis, where it may be training, instead of from its folder.",
        ),
    ] = None,
    api_tls_cert: ApiTlsCert = None,
    api_tls_key: ApiTlsKey = None,
) -> None:
    """Serve a run over HTTP: its schema, its policy, its curve, and actions for observations.

    Stop it with Ctrl-C. Beyond this machine every request needs the token that is printed at the start,
    or that TASKSCHEMA_API_TOKEN sets, or one made by `taskschema token`.
    """
    from taskschema.bus.url import REDIS_VARIABLE
    from taskschema_learner.api import command
    from taskschema_learner.api.address import Address

    address = Address.parse(api)
    options = ["--host", address.host, "--port", str(address.port)]
    for name, file in (("--tls-cert", api_tls_cert), ("--tls-key", api_tls_key)):
        options += [] if file is None else [name, str(file)]
    if redis is None:
        options += ["--folder", str(find_run(run).path)]
    else:
        os.environ[REDIS_VARIABLE] = redis  # where the API's own command looks for it
        options += ["--run", run_name(run)]
    raise typer.Exit(command.main(options))
