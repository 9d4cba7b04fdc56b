"""A person at a real terminal: reads what a command prints, types answers, holds a key down."""

import os
import pty
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress

REPEAT_SECONDS = 0.03
"""Of a terminal's held key."""
HOLD = "Hold h down"
LET_GO = "Let go of the key"
_SCRIPT = """
import taskschema_robot.safety.hold_to_run as hold
hold.FIRST_REPEAT = hold.LONGEST_GAP = 2.0
from taskschema_robot.cli.main import main
main()
"""
PATIENT = [sys.executable, "-c", _SCRIPT]
"""The agent where a machine's other work may hold keys back for a second; real limits have other tests."""

Answer = str | Callable[[], None]


class PersonAtTerminal:
    """Runs a command at a terminal of its own and does what it asks for.

    Args:
        command: that is run.
        answers: what is typed, or done, when such words are printed.

    """

    def __init__(self, command: list[str], answers: dict[str, Answer]) -> None:
        self._leader, follower = pty.openpty()
        self._answers = answers | {HOLD: "", LET_GO: ""}
        self.text = ""
        self.asked: list[str] = []
        self._holding = False
        self.process = subprocess.Popen(command, stdin=follower, stdout=follower, stderr=follower)
        os.close(follower)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._hand = threading.Thread(target=self._hold, daemon=True)
        self._reader.start()
        self._hand.start()

    def type(self, keys: bytes) -> None:
        os.write(self._leader, keys)

    def while_holding(self) -> bytes:
        """Keys to press beside the held one."""
        return b""

    def _read(self) -> None:
        fresh = ""
        with suppress(OSError):
            while data := os.read(self._leader, 4096):
                fresh += data.decode(errors="replace")
                self.text += data.decode(errors="replace")
                while (rest := self._react(fresh)) != fresh:
                    fresh = rest

    def _react(self, fresh: str) -> str:
        """Answer the first thing that is asked; return what was printed after it."""
        found = [(fresh.find(words), words) for words in self._answers if words in fresh]
        if not found:
            return fresh
        place, words = min(found)
        self.asked.append(words)
        answer = self._answers[words]
        if callable(answer):
            answer()
        else:
            self._holding = words == HOLD
            self.type(answer.encode())
        return fresh[place + len(words) :]

    def _hold(self) -> None:
        with suppress(OSError):
            while self.process.poll() is None:
                if self._holding:
                    self.type(b"h")
                    self.type(self.while_holding())
                time.sleep(REPEAT_SECONDS)

    def close(self) -> None:
        self._holding = False
        self.process.kill()  # it would go on with the next slot first; its twin lives in it
        self.process.wait()
        os.close(self._leader)
