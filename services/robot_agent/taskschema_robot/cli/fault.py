"""`taskschema-robot fault`: let something go wrong in a twin."""

from typing import Annotated

import typer

from taskschema.skills.pairs import ARMS
from taskschema_robot.cli.options import TwinAddress
from taskschema_robot.twin.faults import FaultKind


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(fault)


def fault(
    kind: Annotated[FaultKind, typer.Argument(help="What goes wrong.")],
    arm: Annotated[
        str | None, typer.Option(metavar="left|right", help="Whose; without it, both arms'.")
    ] = None,
    off: Annotated[bool, typer.Option("--off", help="Take the fault back instead.")] = False,
    value: Annotated[float, typer.Option(help="Seconds by which a skewed clock is wrong.")] = 1.0,
    twin: TwinAddress = "ws://127.0.0.1:9190",
) -> None:
    """Let something go wrong in a running twin, to see what the agent makes of it.

    A dropped connection breaks once; every other fault lasts until it is taken back with --off. A pressed
    emergency stop is released by --off and still needs a reset.
    """
    from taskschema_robot.twin.client import TwinClient

    if arm is not None and arm not in ARMS:
        raise typer.BadParameter(f"an arm is {' or '.join(ARMS)}, not {arm!r}", param_hint="--arm")
    client = TwinClient(twin)
    try:
        client.inject(kind, None if arm is None else ARMS.index(arm), active=not off, value=value)
    finally:
        client.close()
    print(f"{kind.value}: {'over' if off else 'on'}, {arm or 'both arms'}")
