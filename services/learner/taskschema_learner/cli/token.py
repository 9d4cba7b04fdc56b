"""`taskschema token`: make a token for the HTTP API."""

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(token)


def token(
    name: Annotated[str, typer.Argument(help="Who is to hold it. A token of the same name is replaced.")],
    file: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            envvar="TASKSCHEMA_API_TOKENS_FILE",
            help="File of tokens; the API finds it in TASKSCHEMA_API_TOKENS_FILE. Made if it is not there.",
        ),
    ],
    scope: Annotated[
        list[str] | None,
        typer.Option(metavar="read|control|robot", help="What it allows; may be repeated. Default: read."),
    ] = None,
    days: Annotated[float, typer.Option(min=0, help="Days until it ends; 0: never.")] = 90.0,
    revoke: Annotated[bool, typer.Option("--revoke", help="Remove the token of this name instead.")] = False,
) -> None:
    """Make a token for the HTTP API and print it, once; the file keeps its hash.

    A running API takes the change up at once.
    """
    from datetime import UTC, datetime, timedelta

    import msgspec

    from taskschema.errors import UnknownNameError
    from taskschema_learner.api import tokens
    from taskschema_learner.runs.run_folder import write_atomically

    known = tokens.read_tokens(file).tokens if file.exists() else ()
    others = [item for item in known if item.name != name]
    text = None
    if revoke:
        if len(others) == len(known):
            raise UnknownNameError("token", name, [item.name for item in known])
    else:
        text = tokens.new_token()
        ends = datetime.now(UTC) + timedelta(days=days) if days else None
        others.append(tokens.stored(name, text, tokens.valid_scopes(scope or ["read"]), ends))
    content = msgspec.json.encode(tokens.TokensFile(tuple(others)))
    write_atomically(file, msgspec.json.format(content, indent=1))
    if text is not None:
        print(text)
