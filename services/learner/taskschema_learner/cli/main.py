"""The `taskschema` command's entry point."""

import sys
from typing import Annotated

import typer

from taskschema import __version__
from taskschema.bus.url import hide_password
from taskschema.errors import TaskschemaError
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
    """Run the command; an error that the user can mend is one line on stderr and exit status 1."""
    hide_password()
    arguments = sys.argv[1:]
    debug = "--debug" in arguments
    try:
        app(args=[item for item in arguments if item != "--debug"], prog_name="taskschema")
    except (TaskschemaError, OSError) as error:
        if debug:
            raise
        print(f"Error: {_one_line(error)}", file=sys.stderr)
        raise SystemExit(1) from None


def _one_line(error: TaskschemaError | OSError) -> str:
    if isinstance(error, OSError) and error.strerror:
        place = f": {error.filename}" if error.filename else ""
        return f"{error.strerror}{place}."
    return " ".join(str(error).split())
