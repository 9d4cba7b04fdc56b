"""How commands print what they found."""

import sys
from typing import Annotated, Any

import msgspec
import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON for a program to read.")]
RunReference = Annotated[str, typer.Argument(metavar="RUN", help="A run's folder, or its name below runs/.")]


def print_json(value: Any) -> None:  # noqa: ANN401 - whatever msgspec can encode
    """Print a structure as indented JSON."""
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(value), indent=2).decode() + "\n")
