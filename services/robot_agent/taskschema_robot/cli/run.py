"""`taskschema-robot run`: serve a run with both arms."""

import signal
import threading
from pathlib import Path
from types import FrameType
from typing import Annotated

import typer

from taskschema_robot.cli.options import DriverName, LeftAddress, PyrobotPython, RightAddress


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(run)


def run(
    name: Annotated[str, typer.Argument(metavar="RUN", help="Name of the run, or its folder if it is here.")],
    item: Annotated[str, typer.Option("--object", metavar="OBJECT", help="What stands on the table.")],
    redis: Annotated[
        str | None,
        typer.Option(metavar="URL", envvar="TASKSCHEMA_REDIS_URL", help="The run's Redis, if not in RUN."),
    ] = None,
    twin: Annotated[
        str | None,
        typer.Option(metavar="URL|own", help="A twin's control address; own: one in this process, fast."),
    ] = None,
    left: LeftAddress = None,
    right: RightAddress = None,
    driver: DriverName = "rosbridge",
    pyrobot_python: PyrobotPython = "python3",
    camera: Annotated[
        str | None, typer.Option(metavar="SOURCE", help="Overhead camera: number or URL.")
    ] = None,
    lens: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Its lens, from `calibrate --lens`.")
    ] = None,
    see: Annotated[
        str, typer.Option(metavar="camera|truth", help="truth: the twin's own word instead of markers.")
    ] = "camera",
    folder: Annotated[Path, typer.Option(help="Where the agent keeps its own log.")] = Path("robot-agent"),
    speed_ratio: Annotated[
        float, typer.Option(min=0.01, max=1.0, help="Share of the arms' speed: 0.1 at first.")
    ] = 0.1,
    rate: Annotated[int, typer.Option(min=50, max=100, help="Set-points a second.")] = 100,
    stop_port: Annotated[int, typer.Option(help="POST /stop on this port of this machine stops.")] = 8421,
    hold_to_run: Annotated[
        bool, typer.Option("--hold-to-run", help="Arms move only while h is held down: commissioning.")
    ] = False,
    preview: Annotated[
        bool, typer.Option("--preview", help="Show every plan and ask before it is made: commissioning.")
    ] = False,
    state_from_markers: Annotated[
        bool,
        typer.Option(
            "--state-from-markers",
            help="Real robots: serve a run on states all the same; its policy then sees what markers say.",
        ),
    ] = False,
    unattended: Annotated[
        bool, typer.Option("--unattended", help="Ask nobody, not even for an acknowledgement: for a twin.")
    ] = False,
) -> None:
    """Serve a run: lease its episodes, run them on both arms, stream what happened.

    Start the run with `taskschema train TASK --agent robot`. With --twin, both arms are simulated. A stop
    that this software offers is not safety rated: keep the emergency stop buttons within reach.
    """
    from taskschema.errors import ConfigError, UnknownNameError
    from taskschema_robot.cli.arms import Robots
    from taskschema_robot.cli.serving import Serving, serve

    if (twin is None) == (left is None or right is None):
        raise ConfigError("Say which arms: --twin URL, or --left URL and --right URL, one of both.")
    if twin is None and (unattended or see == "truth"):
        raise ConfigError("Only a twin runs unattended or tells the truth: leave these options out.")
    if see not in ("camera", "truth"):
        raise UnknownNameError("way to see", see, ("camera", "truth"))
    if unattended and (preview or hold_to_run):
        raise ConfigError("--preview and --hold-to-run need a person: leave --unattended out.")
    stop = threading.Event()

    def request(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, request)
    serving = Serving(
        run=name,
        item=item,
        redis=redis,
        twin=twin,
        robots=None if left is None or right is None else Robots((left, right), driver, pyrobot_python),
        camera=camera,
        lens=lens,
        see_truth=see == "truth",
        folder=folder,
        speed_ratio=speed_ratio,
        rate=rate,
        stop_port=stop_port,
        hold_to_run=hold_to_run,
        preview=preview,
        unattended=unattended,
        state_from_markers=state_from_markers,
    )
    serve(serving, stop)
