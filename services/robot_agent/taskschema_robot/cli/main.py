"""The `taskschema-robot` command's entry point."""

from typing import Annotated

import typer

from taskschema import __version__
from taskschema.command_line import run_command
from taskschema_robot.cli import calibrate, check, fault, run, twin

app = typer.Typer(
    help="Drive two Sawyer arms: run episodes with the current policy, on the robots or on their twin.",
    epilog="Start with: taskschema-robot twin. No stop that this software offers is safety rated.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for module in (twin, fault, check, calibrate, run):
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
    run_command(app, "taskschema-robot")
