"""The `taskschema` command's entry point."""

from typing import Annotated

import typer

from taskschema import __version__
from taskschema.command_line import run_command
from taskschema_learner.cli import (
    audit,
    catalogue,
    curves,
    doctor,
    evaluation,
    experiment,
    replay,
    run_facts,
    scale,
    serve,
    token,
    train,
)

app = typer.Typer(
    help="Learn two-armed manipulation from sparse rewards with task schemas.",
    epilog="Start with: taskschema train toy. Add --debug to any command to see where an error comes from.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for module in (
    train,
    serve,
    evaluation,
    run_facts,
    audit,
    experiment,
    replay,
    curves,
    scale,
    token,
    catalogue,
    doctor,
):
    module.register(app)


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        print(__version__)
        raise typer.Exit


def main() -> None:
    """Run the command."""
    run_command(app, "taskschema")
