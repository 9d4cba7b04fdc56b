"""`taskschema-robot check`: the list of the first day on hardware, item by item."""

from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated

import typer

from taskschema_robot.cli.options import DriverName, LeftAddress, PyrobotPython, RightAddress

if TYPE_CHECKING:
    from taskschema_robot.agent.first_day import FirstDay


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(check)


def check(
    twin: Annotated[str | None, typer.Option(metavar="URL", help="Practise on a twin.")] = None,
    left: LeftAddress = None,
    right: RightAddress = None,
    driver: DriverName = "rosbridge",
    pyrobot_python: PyrobotPython = "python3",
    move: Annotated[bool, typer.Option("--move", help="Also move: hands, then both arms, slowly.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Ask nothing: for a twin.")] = False,
) -> None:
    """Walk through what to check on the first day, before anything is learned.

    Without --move nothing moves and nothing is switched on. With it, a person confirms every motion, at a
    tenth of the arms' speed. No stop that this software offers is safety rated.
    """
    from taskschema.errors import ConfigError
    from taskschema.safety.limits import SafetyLimits
    from taskschema_robot.agent.first_day import FirstDay
    from taskschema_robot.cli.arms import Robots, distant_twin, robot_hardware, twin_hardware
    from taskschema_robot.errors import NotReadyError
    from taskschema_robot.safety.gate import SafetyGate

    if (twin is None) == (left is None or right is None):
        raise ConfigError("Say which arms: --twin URL, or --left URL and --right URL, one of both.")
    if yes and twin is None:
        raise ConfigError("Only a twin is checked without a person: leave --yes out.")
    with ExitStack() as stack:
        if twin is not None:
            hardware = twin_hardware(stack, distant_twin(stack, twin))
        else:
            assert left is not None
            assert right is not None
            hardware = robot_hardware(stack, Robots((left, right), driver, pyrobot_python))
        limits = SafetyLimits(speed_ratio=0.1)
        gate = SafetyGate(hardware.drivers, hardware.clock, limits)
        day = FirstDay(gate, hardware.clock, limits, _confirmation(yes), print)
        if not _walk(day, move):
            raise NotReadyError("Not everything is as it should be: mend what is marked, and check again.")


def _confirmation(yes: bool) -> Callable[[str], bool]:
    if yes:
        return lambda question: True
    return lambda question: input(f"{question} [y/n] ").strip().lower().startswith("y")


def _walk(day: "FirstDay", move: bool) -> bool:
    good = day.look()
    return day.move() and good if move and good else good
