"""`taskschema-robot check`: the list of the first day on hardware, item by item."""

import sys
import threading
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskschema_robot.cli.options import DriverName, LeftAddress, PyrobotPython, RightAddress

if TYPE_CHECKING:
    from taskschema_robot.agent.first_day import FirstDay, Look
    from taskschema_robot.agent.first_day_person import FirstDayPerson
    from taskschema_robot.cli.arms import Hardware
    from taskschema_robot.cli.person import Person


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(check)


def check(
    twin: Annotated[str | None, typer.Option(metavar="URL", help="Practise on a twin.")] = None,
    left: LeftAddress = None,
    right: RightAddress = None,
    driver: DriverName = "rosbridge",
    pyrobot_python: PyrobotPython = "python3",
    camera: Annotated[
        str | None, typer.Option(metavar="SOURCE", help="Also look through this camera: number or URL.")
    ] = None,
    lens: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Its lens, from `calibrate --lens`.")
    ] = None,
    name: Annotated[
        str | None, typer.Option("--run", metavar="RUN", help="Also look for this run, or its folder.")
    ] = None,
    redis: Annotated[
        str | None,
        typer.Option(metavar="URL", envvar="TASKSCHEMA_REDIS_URL", help="The run's Redis, if not in RUN."),
    ] = None,
    move: Annotated[bool, typer.Option("--move", help="Also move: hands, then both arms, slowly.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Ask nothing: for a twin.")] = False,
    hold_to_run: Annotated[
        bool, typer.Option(help="With --move: the arms move only while h is held down.")
    ] = True,
    stop_port: Annotated[int, typer.Option(help="POST /stop on this port of this machine stops.")] = 8421,
) -> None:
    """Walk through what to check on the first day, before anything is learned.

    Without --move nothing moves and nothing is switched on. With it, a person confirms every motion, at a
    tenth of the arms' speed; space or s stops both arms, and so does letting go of h. No stop that this
    software offers is safety rated.
    """
    from taskschema.errors import ConfigError
    from taskschema.safety.limits import SafetyLimits
    from taskschema_robot.agent.first_day import FirstDay
    from taskschema_robot.cli.arms import Robots, distant_twin, robot_hardware, twin_hardware
    from taskschema_robot.cli.person import unattended_person
    from taskschema_robot.cli.stops import let_stop
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
        looks = [*_camera(stack, hardware, camera, lens), *_run(name, redis)]
        person = _person(hold_to_run=hold_to_run) if move and not yes else unattended_person()
        gate = SafetyGate(hardware.drivers, hardware.clock, limits, person.monitors)
        helper = _helper(hardware, person)
        day = FirstDay(gate, hardware.clock, limits, helper, print, looks, person.attend(gate))
        let_stop(stack, person, day.stop, stop_port if move and not yes else None)
        if not _walk(day, move):
            raise NotReadyError("Not everything is as it should be: mend what is marked, and check again.")


def _camera(stack: ExitStack, hardware: "Hardware", source: str | None, lens: Path | None) -> "list[Look]":
    """Return what looks through the overhead camera, if there is one."""
    from taskschema_robot.agent.surroundings import look_through
    from taskschema_robot.cli.eyes import open_eyes

    if hardware.twin is None and source is None:
        print("left  camera: nobody looks through it without --camera SOURCE and --lens FILE")
        return []
    eyes = open_eyes(stack, hardware, source, lens)
    return [partial(look_through, eyes.camera, eyes.intrinsics, hardware.clock)]


def _run(name: str | None, redis: str | None) -> "list[Look]":
    """Return what looks for the run, if one is named."""
    from taskschema_robot.agent.surroundings import look_for_run
    from taskschema_robot.cli.serving import embedded_redis_url

    if name is None:
        print("left  run: nobody looks for one without --run RUN")
        return []
    return [partial(look_for_run, redis or embedded_redis_url(Path(name)), Path(name).name)]


def _person(*, hold_to_run: bool) -> "Person":
    """Return the person at this terminal, with the keys that `run` has.

    Raises:
        ConfigError: if this is no terminal: nobody could stop the arms.

    """
    from taskschema.errors import ConfigError
    from taskschema_robot.cli.person import person_at_terminal

    if not sys.stdin.isatty():
        raise ConfigError("Arms move only at a terminal, whose keys stop them: type the command in one.")
    return person_at_terminal(Path(), threading.Event(), hold_to_run=hold_to_run, preview=False)


def _helper(hardware: "Hardware", person: "Person") -> "FirstDayPerson":
    """Return who confirms and presses: the person, if there is one."""
    from taskschema_robot.agent.first_day_person import PersonAtTerminal, TwinOnFirstDay
    from taskschema_robot.agent.keyboard import Keyboard

    if hardware.twin is not None and not isinstance(person.keyboard, Keyboard):
        return TwinOnFirstDay(hardware.twin, hardware.clock)
    return PersonAtTerminal(person.keyboard.ask if isinstance(person.keyboard, Keyboard) else input)


def _walk(day: "FirstDay", move: bool) -> bool:
    good = day.look()
    return day.move() and good if move and good else good
