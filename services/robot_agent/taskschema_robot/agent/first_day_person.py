"""Who helps on the first day: a person at a terminal, or a twin that presses its own buttons."""

import contextlib
import math
import threading
import time
from collections.abc import Callable
from typing import Protocol

from taskschema.skills.pairs import ARMS
from taskschema_robot.clock import Clock
from taskschema_robot.twin.client import TwinClient
from taskschema_robot.twin.faults import FaultKind

TWIN_SECONDS = 3.0
"""Of a twin's time, after which it is stopped in the middle of a motion [s]."""
LOOK_SECONDS = 0.002
LONGEST_WAIT = 60.0
"""[s]"""


class FirstDayPerson(Protocol):
    """Confirms, presses and releases; nothing here waits for what the robot shows itself."""

    def confirm(self, question: str) -> bool:
        """Return whether something may be done."""
        ...

    def press_button(self, arm: int, *, pressed: bool) -> None:
        """Have the emergency stop of an arm (0 left, 1 right) pressed, or released."""
        ...

    def press_stop_key(self, stop: Callable[[str], None]) -> None:
        """Have both arms stopped while they move: `stop` is what the key calls."""
        ...

    def measure(self, question: str) -> tuple[float, float] | None:
        """Return a distance along x and along y [mm]; None if nobody measures it."""
        ...


class PersonAtTerminal:
    """A person, who is asked; see `FirstDayPerson`.

    Args:
        ask: asks a question and returns the line typed.

    """

    def __init__(self, ask: Callable[[str], str]) -> None:
        self._ask = ask

    def confirm(self, question: str) -> bool:
        """Ask; see `FirstDayPerson`."""
        return self._ask(f"{question} [y/n] ").strip().lower().startswith("y")

    def press_button(self, arm: int, *, pressed: bool) -> None:
        """Ask for a button; see `FirstDayPerson`."""
        print(f"  {'Press' if pressed else 'Release'} the {ARMS[arm]} robot's emergency stop button now.")

    def press_stop_key(self, stop: Callable[[str], None]) -> None:
        """Ask for the key, whose own thread calls what stops; see `FirstDayPerson`."""
        print("  Press the space bar as soon as the wrists turn.", flush=True)

    def measure(self, question: str) -> tuple[float, float] | None:
        """Ask until two numbers are typed, or nothing; see `FirstDayPerson`."""
        while line := self._ask(f"{question} (two numbers in mm, x then y; Enter: not measured) ").split():
            with contextlib.suppress(ValueError):
                x, y = map(float, line)
                if math.isfinite(x + y):
                    return x, y
        return None


class TwinOnFirstDay:
    """A twin without a person; see `FirstDayPerson`."""

    def __init__(self, twin: TwinClient, clock: Clock) -> None:
        self._twin, self._clock = twin, clock

    def confirm(self, question: str) -> bool:
        """Say yes; see `FirstDayPerson`."""
        return True

    def press_button(self, arm: int, *, pressed: bool) -> None:
        """Press it; see `FirstDayPerson`."""
        self._twin.inject(FaultKind.PRESS_EMERGENCY_STOP, arm, active=pressed)

    def press_stop_key(self, stop: Callable[[str], None]) -> None:
        """Stop from a thread, as a key does, once some of the twin's time has passed."""
        due, latest = self._clock.now() + TWIN_SECONDS, time.monotonic() + LONGEST_WAIT

        def press() -> None:
            while self._clock.now() < due and time.monotonic() < latest:
                time.sleep(LOOK_SECONDS)
            if self._clock.now() >= due:
                stop("the stop key")

        threading.Thread(target=press, name="stop-key", daemon=True).start()

    def measure(self, question: str) -> tuple[float, float] | None:
        """Measure nothing; see `FirstDayPerson`."""
        return None
