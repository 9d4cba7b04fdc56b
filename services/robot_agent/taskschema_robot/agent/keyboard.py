"""Single keys from a terminal: the stop key works whatever else the agent is doing."""

import contextlib
import os
import queue
import select
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from typing import TextIO

from taskschema_robot.agent.world import SessionEndedError
from taskschema_robot.safety.hold_to_run import LONGEST_GAP

STOP_KEYS = (" ", "s", "S")
LOOK_SECONDS = 0.05
"""Longest time until a key is seen [s]."""
MOST_BYTES = 1024
"""Read at once; every one of them is looked at."""
RELEASE_SECONDS = LONGEST_GAP + 0.1
"""Without a key, after which one that was held is taken for released [s], by whoever watches it, too."""
RELEASE_PATIENCE = 5.0
"""How long a question waits for that [s]."""


class Keyboard:
    """Reads keys in a thread. A context manager: leaves the terminal as it was.

    Keys are read as bytes, past every buffer: what a buffer holds, nobody is told of.

    Args:
        on_stop: called at once, in the reading thread, for a stop key, and when the terminal is gone: nobody
            could stop the arms there any more.
        on_key: told of every other key, a held one's repeats among them; returns whether it was meant for it.
        stream: a terminal.

    """

    def __init__(
        self,
        on_stop: Callable[[], None],
        on_key: Callable[[str], bool] = lambda key: False,
        stream: TextIO = sys.stdin,
    ) -> None:
        self._on_stop = on_stop
        self._on_key = on_key
        self._stream = stream
        self._keys: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._asking = threading.Event()
        self._turn = threading.Lock()
        self._last_key = -float("inf")
        self._thread = threading.Thread(target=self._read, name="keyboard", daemon=True)

    def __enter__(self) -> "Keyboard":
        self._before = termios.tcgetattr(self._stream)
        tty.setcbreak(self._stream)
        self._thread.start()
        return self

    def __exit__(self, *unused: object) -> None:
        self._stop.set()
        self._thread.join(1.0)
        with contextlib.suppress(termios.error):  # a terminal that is gone
            termios.tcsetattr(self._stream, termios.TCSADRAIN, self._before)

    def take(self) -> str | None:
        """Return the oldest key that was not taken yet, or None."""
        with contextlib.suppress(queue.Empty):
            return self._keys.get_nowait()
        return None

    def ask(self, question: str, ended: Callable[[], bool] | None = None) -> str:
        """Ask for a line, typed and edited as usual; nothing moves meanwhile.

        A key that is still held down from a motion is no part of the answer: it is waited for.

        Raises:
            SessionEndedError: as soon as `ended` says so: nobody is waited for any more.

        """
        deadline = time.monotonic() + RELEASE_PATIENCE
        if time.monotonic() < self._last_key + RELEASE_SECONDS:
            print("Let go of the key.", flush=True)
        while time.monotonic() < min(self._last_key + RELEASE_SECONDS, deadline):
            time.sleep(LOOK_SECONDS)
        with self._line_mode():
            if ended is None:
                return input(question)
            print(question, end="", flush=True)
            while not self._ready(LOOK_SECONDS):
                if ended():
                    raise SessionEndedError("The session is to end.")
            return input()

    @contextlib.contextmanager
    def _line_mode(self) -> Iterator[None]:
        with self._turn:
            self._asking.set()
            termios.tcsetattr(self._stream, termios.TCSAFLUSH, self._before)
        try:
            yield
        finally:
            tty.setcbreak(self._stream)
            self._asking.clear()

    def _read(self) -> None:
        while not self._stop.is_set():
            if self._asking.is_set():
                self._stop.wait(LOOK_SECONDS)
                continue
            if not self._ready(LOOK_SECONDS):
                continue
            with self._turn:
                if self._asking.is_set() or not self._ready(0.0):
                    continue
                keys = self._pressed()
            if not keys:
                self._on_stop()
                return
            self._last_key = time.monotonic()
            for key in keys:
                self._look_at(key)

    def _ready(self, seconds: float) -> bool:
        return bool(select.select([self._stream], [], [], seconds)[0])

    def _pressed(self) -> str:
        """Return every key that waits; none: the terminal is gone."""
        try:
            return os.read(self._stream.fileno(), MOST_BYTES).decode("latin-1")
        except OSError:
            return ""

    def _look_at(self, key: str) -> None:
        if key in STOP_KEYS:
            self._on_stop()
        elif not self._on_key(key):
            self._keys.put(key)
