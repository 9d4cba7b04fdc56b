"""Options that several subcommands share."""

from typing import Annotated

import typer

TwinAddress = Annotated[
    str, typer.Option("--twin", metavar="URL", help="The twin's control address, as `twin` prints it.")
]
