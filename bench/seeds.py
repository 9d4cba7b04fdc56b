"""Row 13: minutes and episodes to 90 % of `taskschema train lateral-lifting`, from the command to its end."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench.entry import Entry
from bench.service_process import TASK, free_port
from taskschema.metrics import RoundMetrics
from taskschema_learner.runs.run_folder import RunFolder

GOAL = 0.9
ROUNDS = 250
"""Rounds after which a seed is given up: 50,000 episodes, several times what the slowest has needed."""


def measure(repeats: int) -> list[Entry]:
    """Train one seed a repeat; those that are given up are left out, and the names of the rows say so."""
    minutes, episodes = [], []
    for seed in range(repeats):
        taken, last = train(TASK, seed, ROUNDS)
        print(
            f"  seed {seed}: {taken:.2f} min, {last.episodes:,} episodes, "
            f"{last.success_last_100:.0%} of the last 100 succeed",
            flush=True,
        )
        if last.success_last_100 >= GOAL:
            minutes.append(taken)
            episodes.append(float(last.episodes))
    if not minutes:
        return []
    seeds = f"{repeats} seeds" if len(minutes) == repeats else f"{len(minutes)} of {repeats} seeds"
    return [
        Entry.of(13, f"`make train` to 90 %, median of {seeds}", minutes, "min", 15, "lower"),
        Entry.of(13, f"episodes to 90 %, median of {seeds}", episodes, "", None, "lower"),
    ]


def train(task: str, seed: int, rounds: int) -> tuple[float, RoundMetrics]:
    """Return the minutes that a training takes until its command has ended, and its last round.

    Raises:
        RuntimeError: if it fails.
    """
    with tempfile.TemporaryDirectory(prefix="bench-") as temporary:
        folder = Path(temporary) / "run"
        command = [str(Path(sys.executable).with_name("taskschema")), "train", task, "--seed", str(seed)]
        command += ["--rounds", str(rounds), "--run-dir", str(folder), "--api", f"127.0.0.1:{free_port()}"]
        started = time.monotonic()
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        minutes = (time.monotonic() - started) / 60
        if done.returncode:
            raise RuntimeError(f"Seed {seed} was not trained:\n{done.stdout[-2000:]}")
        return minutes, RunFolder.open(folder).read_metrics()[-1]
