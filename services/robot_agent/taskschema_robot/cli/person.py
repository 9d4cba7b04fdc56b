"""The person beside the robots, and everything that they hold: keys, questions, previews. Or nobody."""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path

from taskschema.safety.motion import Motion
from taskschema.safety.refusal import Refusal
from taskschema_robot.agent.attended_arms import AttendedArms
from taskschema_robot.agent.episode import Preview
from taskschema_robot.agent.operator import Operator, Unattended
from taskschema_robot.agent.terminal_operator import TerminalOperator
from taskschema_robot.agent.twin_person import TwinPerson
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.reward.camera_world import ResetPerson
from taskschema_robot.safety.gated_arms import GatedArms
from taskschema_robot.safety.hold_to_run import HOLD_KEY, HoldToRun
from taskschema_robot.safety.watchdog import Monitor
from taskschema_robot.twin.client import TwinClient

Stop = Callable[[str], None]


@dataclass
class Person:
    """Who answers, and how."""

    operator: Operator
    reset_person: ResetPerson | None = None
    """Who puts the object back beside real robots, and answers what the camera cannot see; None: nobody."""
    monitors: list[Monitor] = field(default_factory=list)
    preview: Preview | None = None
    keyboard: AbstractContextManager[object] = field(default_factory=nullcontext)
    stops: list[Stop] = field(default_factory=list)
    """What a stop key calls, once there is a gate."""
    attend: Callable[[GatedArms], GatedArms] = lambda arms: arms
    """Makes arms of those behind the gate that wait for the person before every motion, if they are to."""

    def on_stop(self, stop: Stop) -> None:
        """Let the stop key stop the arms."""
        self.stops.append(stop)

    def listening(self) -> AbstractContextManager[object]:
        """Return what listens to the keys."""
        return self.keyboard

    def resets(self, twin: TwinClient | None) -> ResetPerson:
        """Return who puts the object back: a twin does so itself."""
        if twin is not None:
            return TwinPerson(twin, self.reset_person)
        if self.reset_person is None:
            raise ValueError("nobody is there to put the object back")
        return self.reset_person


def unattended_person() -> Person:
    """Return nobody."""
    return Person(Unattended())


def person_at_terminal(folder: Path, stop: threading.Event, *, hold_to_run: bool, preview: bool) -> Person:
    """Return the person at this terminal."""
    from rich.console import Console

    from taskschema_robot.agent.keyboard import Keyboard

    stops: list[Stop] = []
    held = HoldToRun()

    def stop_now() -> None:
        for call in stops:
            call("the stop key")

    console = Console(highlight=False)
    keyboard = Keyboard(stop_now, held.take if hold_to_run else lambda key: False)
    operator = TerminalOperator(console, keyboard.take, keyboard.ask, folder, stop.set, ended=stop.is_set)
    person = Person(
        operator,
        operator,
        preview=_preview(folder, keyboard.ask) if preview else None,
        keyboard=keyboard,
        stops=stops,
    )
    if hold_to_run:
        words = f"[bold]Hold {HOLD_KEY} down[/bold] for as long as the arms may move; let go to stop them."
        person.monitors.append(held)
        person.attend = lambda arms: AttendedArms(arms, lambda: held.held, lambda: console.print(words))
    return person


def _preview(folder: Path, ask: Callable[[str], str]) -> Preview:
    """Return what draws every plan and asks a person."""
    from taskschema_robot.safety.picture import draw_motion

    def show(motion: Motion, refusal: Refusal | None, title: str) -> None:
        path = folder / "preview.png"
        draw_motion(path, motion, refusal, title)
        words = f"refused: {refusal.reason}" if refusal else f"{motion.duration:.1f} s"
        question = f"{title} ({words}), see {path}. Enter to go on, n to drop the episode: "
        while answer := ask(question).strip():
            if answer == "n":
                raise EpisodeDroppedError("A person did not want the plan.")

    return show
