"""A training with everything in it, as a person in front of a terminal has it."""

import json
import os
import pty
import re
import select
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import psutil
import pytest

ROOT = Path(__file__).parents[2]
COMMAND = Path(sys.executable).with_name("taskschema")


class Terminal:
    """A command in a pseudo-terminal, read in the background."""

    def __init__(self, place, *arguments):
        self.process_id, self._screen = pty.fork()
        if self.process_id == 0:
            os.chdir(place)
            os.execv(COMMAND, ["taskschema", *arguments])
        self.text = ""
        self.status = None
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self):
        while True:
            ready, _, _ = select.select([self._screen], [], [], 0.1)
            try:
                data = os.read(self._screen, 65536) if ready else None
            except OSError:
                data = b""
            if data == b"":
                break
            self.text += (data or b"").decode(errors="replace")
        self.status = os.waitstatus_to_exitcode(os.waitpid(self.process_id, 0)[1])

    def wait_for(self, pattern, seconds=90.0):
        deadline = time.monotonic() + seconds
        while (match := re.search(pattern, self.text)) is None:
            assert self.status is None, self.text
            assert time.monotonic() < deadline, self.text[-3000:]
            threading.Event().wait(0.05)
        return match

    def type(self, text):
        os.write(self._screen, text)

    def wait(self, seconds):
        self._reader.join(seconds)
        assert self.status is not None, self.text[-3000:]


@pytest.fixture
def terminal(tmp_path):
    options = ("--workers", "1", "--slots", "10", "--until-success", "0", "--api", "127.0.0.1:0")
    terminal = Terminal(tmp_path, "train", "toy", *options)
    yield terminal
    if terminal.status is None:
        terminal.type(b"\x03")
        terminal.wait(30)


def test_a_person_sees_scales_stops_and_resumes_a_training(terminal, tmp_path):
    api = terminal.wait_for(r"API: (http://127\.0\.0\.1:\d+)")[1]
    terminal.wait_for(r"Token for requests that change something: \S+")
    terminal.wait_for(r"slot \d+ of 10")
    terminal.wait_for("episodes, .* a second, time left: unknown yet")
    terminal.wait_for("Task schema")

    subprocess.run([COMMAND, "scale", "3"], cwd=tmp_path, check=True, timeout=60)
    deadline = time.monotonic() + 60
    while True:
        with urllib.request.urlopen(f"{api}/workers", timeout=5) as answer:
            if len(json.load(answer)["workers"]) == 3:
                break
        assert time.monotonic() < deadline
        threading.Event().wait(0.2)

    processes = psutil.Process(terminal.process_id).children(recursive=True)
    stopped = time.monotonic()
    terminal.type(b"\x03")
    terminal.wait(20)
    elapsed = time.monotonic() - stopped
    assert terminal.status == 0
    _, alive = psutil.wait_procs(processes, timeout=1)
    assert alive == []
    assert elapsed < 5 or os.getloadavg()[0] > 2 * (os.cpu_count() or 1), f"stopping took {elapsed:.1f} s"
    assert "Traceback" not in terminal.text

    resume = re.search(r"Continue with: (.+?)\r?\n", terminal.text)[1].split()
    assert resume[:3] == ["taskschema", "train", "--resume"]
    result = subprocess.run(
        [COMMAND, *resume[1:], "--workers", "0", "--rounds", "1", "--api", "none"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
    assert "Going on after" in result.stdout


def test_the_toy_s_own_file_is_a_task_file_that_works(tmp_path):
    """docs/add-a-task.md shows it."""
    file = f"{ROOT / 'shared/taskschema/tasks/toy.py'}:Toy"
    options = ["--task-file", file, "--workers", "0", "--slots", "3", "--rounds", "2", "--api", "none"]
    result = subprocess.run(
        [COMMAND, "train", *options], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "runs" / "toy-schema-seed0" / "curve.png").exists()
    again = subprocess.run(
        [COMMAND, "verify", "toy-schema-seed0"], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert again.returncode == 0, again.stderr
