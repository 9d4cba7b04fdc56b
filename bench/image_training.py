"""Skill steps a second of trainings on images: `python -m bench.image_training`.

`taskschema train lateral-lifting --observation image` with the schema given, as a user starts it, with Redis,
Ray and some workers on this machine's cores: wall time of whole rounds, from the second one on.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from taskschema.metrics import RoundMetrics
from taskschema_learner.machine import machine
from taskschema_learner.run_folder import RunFolder

TASK = "lateral-lifting"


def train(workers: int, slots: int, rounds: int) -> list[RoundMetrics]:
    """Return a row for each round of a training; in the first, workers start."""
    with tempfile.TemporaryDirectory(prefix="bench-") as temporary:
        folder = Path(temporary) / "run"
        command = [str(Path(sys.executable).with_name("taskschema")), "train", TASK, "--observation", "image"]
        command += ["--policy", "oracle", "--slots", str(slots), "--rounds", str(rounds + 1)]
        command += ["--workers", str(workers), "--until-success", "0", "--api", "none"]
        subprocess.run([*command, "--run-dir", str(folder)], check=True, stdout=subprocess.DEVNULL)
        return RunFolder.open(folder).read_metrics()


def row(workers: int, found: list[RoundMetrics]) -> str:
    """Return a line of the table: rates and shares of the wall time of all rounds but the first."""
    first, *rest = found
    steps = rest[-1].steps - first.steps
    collecting, learning = (
        sum(item.seconds_collect for item in rest),
        sum(item.seconds_update for item in rest),
    )
    writing = sum(item.seconds_checkpoint for item in rest)
    seconds = collecting + learning + writing
    shares = " | ".join(f"{part / seconds:.0%}" for part in (collecting, learning, writing))
    return f"| {workers} | {steps / seconds:.1f} | {seconds / len(rest):.1f} | {shares} |"


def main() -> None:
    """Print a row of Markdown for each number of workers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--slots", type=int, default=50)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    print(f"On {machine()}, wall time, {options.rounds} rounds of {options.slots} slots.\n")
    print("| workers | skill steps a second | s a round | collecting | learning | checkpoint |")
    print("|---|---|---|---|---|---|")
    for workers in options.workers:
        print(row(workers, train(workers, options.slots, options.rounds)), flush=True)


if __name__ == "__main__":
    main()
