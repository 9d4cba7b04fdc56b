"""The person beside the robots, at a terminal: what happens next, resets, pause, undo, faults."""

import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn, Protocol

from rich.console import Console
from rich.panel import Panel
from rich.table import Table

from taskschema.arrays import FloatArray
from taskschema_robot.agent.episode import EpisodeRecord
from taskschema_robot.agent.progress import Progress
from taskschema_robot.agent.reset_picture import draw_reset
from taskschema_robot.agent.world import SessionEndedError
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.reward.judge import Judgement
from taskschema_robot.safety.fault import Fault

log = logging.getLogger("taskschema.robot")

KEYS = "space or s: STOP both arms (not safety rated)   p: pause   u: undo an outcome   d: drop it   q: quit"
UNDO_SECONDS = 3.0
"""How long an outcome waits for a person's veto [s]."""
POLL_SECONDS = 0.05


class ReadLine(Protocol):
    """Asks a question and waits for a line."""

    def __call__(self, question: str, ended: Callable[[], bool] | None = None) -> str:
        """Return the line; with `ended`, raise SessionEndedError as soon as that says so."""
        ...


class TerminalOperator:
    """See `Operator` and `ResetPerson`.

    Args:
        console: where to write.
        take_key: the next key pressed since it was last asked for, or None; stop keys never come here.
        read_line: asks a question and waits for a line.
        folder: of pictures.
        quit_requested: told when a person wants to end.
        undo_seconds: how long an outcome waits for a veto.
        ended: whether the session is to end, by a signal for example: nothing is waited for then that only a
            next episode needs.

    """

    def __init__(
        self,
        console: Console,
        take_key: Callable[[], str | None],
        read_line: ReadLine,
        folder: Path,
        quit_requested: Callable[[], None],
        undo_seconds: float = UNDO_SECONDS,
        ended: Callable[[], bool] = lambda: False,
    ) -> None:
        self._console = console
        self._take_key = take_key
        self._read_line = read_line
        self._folder = folder
        self._quit_requested = quit_requested
        self._undo_seconds = undo_seconds
        self._ended = ended

    def begin(self, progress: Progress, key: str) -> None:
        """Show progress and what happens next; wait while paused."""
        table = Table.grid(padding=(0, 3))
        left = progress.hours_left()
        table.add_row("next", key)
        table.add_row("done", f"{progress.episodes} episodes; dropped tries: {progress.dropped}")
        table.add_row("so far", f"{progress.skills} skills, {progress.hours:.1f} hours on the robot's clock")
        table.add_row("success", f"{progress.success:.0%} of the last {len(progress.recent)}, to 90 % of 100")
        table.add_row("hours left", "unknown yet" if left is None else f"{left:.1f}")
        self._console.print(Panel(table, title="Next episode", subtitle=KEYS))
        while (pressed := self._take_key()) is not None:
            if pressed == "q":
                self._quit()
            if pressed == "p":
                self._pause(self._ended)

    def review(self, record: EpisodeRecord) -> bool | None:
        """Show the outcome; a person may undo it for a few seconds."""
        steps = "; ".join(", ".join(pair) for pair in record.skills)
        self._console.print(
            f"{steps}: [bold]{record.outcome}[/bold] ({record.reason}), {record.seconds:.0f} s"
        )
        for refusal in record.refusals:
            self._console.print(f"  refused: {refusal}")
        success = record.outcome == "success"
        deadline = time.monotonic() + self._undo_seconds
        while time.monotonic() < deadline:
            pressed = self._take_key()
            if pressed == "d":
                return None
            if pressed == "u":
                return self._ask(
                    f"It was a {'failure' if success else 'success'} then? y / n / d to drop: ", success
                )
            if pressed == "p":
                self._pause()
            time.sleep(POLL_SECONDS)
        return success

    def _pause(self, ended: Callable[[], bool] | None = None) -> None:
        log.info("A person paused")
        self._read_line("Paused; nothing moves. Press Enter to go on. ", ended)
        log.info("A person goes on")

    def _quit(self) -> NoReturn:
        log.info("A person ends the session")
        self._quit_requested()
        raise SessionEndedError("A person ended the session.")

    def _ask(self, question: str, success: bool) -> bool | None:
        answer = self._read_line(question).strip().lower()[:1]
        return None if answer == "d" else (not success if answer == "y" else success)

    def acknowledge(self, fault: Fault) -> str:
        """Show why the arms stopped, until a person gives a name."""
        words = (
            f"{fault.reason}\n\nBoth arms are stopped, their hands keep what they hold, the episode does not "
            "count. Look at the robots: once you acknowledge, they slowly put down what they hold, open, and "
            "go home. Nothing moves before."
        )
        self._console.print(Panel(words, title=f"FAULT: {fault.kind}", style="bold red"))
        while not (name := self._read_line("Your name, to acknowledge: ").strip()):
            pass
        return name

    def release(self, reason: str) -> None:
        """Show why the hands cannot put down what they hold, until a person has taken it."""
        words = (
            f"{reason}\n\nThe hands hold the object in the air and cannot put it down. Take it, with your "
            "fingers clear of theirs: they open once you press Enter, and the arms go home slowly."
        )
        self._console.print(Panel(words, title="TAKE THE OBJECT", style="bold yellow"))
        self._read_line("Press Enter when you hold it: ")
        log.info("A person has taken the object")

    def dropped(self, reason: str) -> None:
        """Say that an episode does not count."""
        self._console.print(f"[yellow]Dropped, neither success nor failure:[/yellow] {reason}")

    def ask_reset(self, item: RobotObject, wanted: FloatArray, problem: str) -> None:
        """Ask for the object at a place, with a picture of it."""
        picture = self._folder / "reset.png"
        draw_reset(picture, item, wanted)
        if problem:
            self._console.print(f"[yellow]Not yet:[/yellow] {problem}")
        steps = "\n".join(f"{number}. {step}" for number, step in enumerate(item.reset, 1))
        where = f"Centre at x {100 * wanted[0]:+.0f} cm, y {100 * wanted[1]:+.0f} cm of the table's centre."
        self._console.print(Panel(f"{steps}\n{where}\nPicture: {picture}", title=f"Reset: {item.name}"))
        log.info("Reset asked for%s", f": {problem}" if problem else "")
        question = "Press Enter when it is there and you are clear of the arms. "
        if self._read_line(question, self._ended).strip() == "q":
            self._quit()

    def ask_outcome(self, judgement: Judgement) -> bool | None:
        """Ask what the camera does not see."""
        self._console.print(f"The outcome is unknown: {judgement.reason}")
        answer = self._read_line("Was it a success? y / n / Enter if you do not know: ").strip().lower()[:1]
        said = {"y": True, "n": False}.get(answer)
        words = {True: "a success", False: "a failure", None: "not known"}[said]
        log.info("The outcome is unknown (%s); by a person's word it is %s", judgement.reason, words)
        return said
