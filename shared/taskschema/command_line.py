"""What both commands, `taskschema` and `taskschema-robot`, do about their words and their errors."""

import sys
from collections.abc import Callable

from taskschema.bus.url import hide_password
from taskschema.errors import TaskschemaError

DEBUG = "--debug"
"""Anywhere among the words: show where an error comes from."""


def run_command(app: Callable[..., object], name: str) -> None:
    """Run a typer application on this program's words.

    An error that the user can mend is one line on standard error and exit status 1.
    """
    hide_password()
    words = sys.argv[1:]
    try:
        app(args=[word for word in words if word != DEBUG], prog_name=name)
    except (TaskschemaError, OSError) as error:
        if DEBUG in words:
            raise
        print(f"Error: {_one_line(error)}", file=sys.stderr)
        raise SystemExit(1) from None


def _one_line(error: TaskschemaError | OSError) -> str:
    if isinstance(error, OSError) and error.strerror:
        place = f": {error.filename}" if error.filename else ""
        return f"{error.strerror}{place}."
    return " ".join(str(error).split())
