"""`taskschema-robot run`: serve a run with both arms."""

import signal
import threading
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from taskschema_robot.agent.operator import Operator


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(run)


def run(
    name: Annotated[str, typer.Argument(metavar="RUN", help="Name of the run, or its folder if it is here.")],
    item: Annotated[str, typer.Option("--object", metavar="OBJECT", help="What stands on the table.")],
    redis: Annotated[
        str | None,
        typer.Option(
            metavar="URL", envvar="TASKSCHEMA_REDIS_URL", help="The run's Redis, if it is not here."
        ),
    ] = None,
    twin: Annotated[
        str | None, typer.Option(metavar="URL", help="A twin's control address, as `twin` prints it.")
    ] = None,
    left: Annotated[str | None, typer.Option(metavar="URL", help="Left robot's rosbridge.")] = None,
    right: Annotated[str | None, typer.Option(metavar="URL", help="Right robot's rosbridge.")] = None,
    folder: Annotated[Path, typer.Option(help="Where the agent keeps its own log.")] = Path("robot-agent"),
    speed_ratio: Annotated[
        float, typer.Option(min=0.01, max=1.0, help="Share of the arms' speed: 0.1 at first.")
    ] = 0.1,
    rate: Annotated[int, typer.Option(min=50, max=100, help="Set-points a second.")] = 100,
    unattended: Annotated[
        bool, typer.Option("--unattended", help="Ask nobody: a twin's object puts itself back.")
    ] = False,
) -> None:
    """Serve a run: lease its episodes, run them on both arms, stream what happened.

    Start the run with `taskschema train TASK --agent robot`. With --twin, both arms are simulated. A stop
    that this software offers is not safety rated: keep the emergency stop buttons within reach.
    """
    from taskschema.errors import ConfigError
    from taskschema_robot.cli.serving import Serving, serve

    if (twin is None) == (left is None or right is None):
        raise ConfigError("Say which arms: --twin URL, or --left URL and --right URL, one of both.")
    if unattended and twin is None:
        raise ConfigError("Only a twin runs unattended: leave --unattended out.")
    stop = threading.Event()

    def request(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, request)
    serve(
        Serving(name, item, redis, twin, left, right, folder, speed_ratio, rate), _operator(unattended), stop
    )


def _operator(unattended: bool) -> "Operator":
    from taskschema_robot.agent.operator import Unattended

    return Unattended()
