"""Skill steps a second of trainings on images: `python -m bench.image_training`.

`taskschema train lateral-lifting --observation image` with the schema given, as a user starts it, with Redis,
Ray and some workers on this machine's cores: wall time of whole rounds, from the second one on. `--write`
brings the table into docs/train-from-images.md.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.images import PAGE, publish
from taskschema.metrics import RoundMetrics
from taskschema_learner.machine import machine, today
from taskschema_learner.runs.run_folder import RunFolder

BEGIN = "<!-- measured: written by python -m bench.image_training -->"
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
    parser.add_argument("--write", action="store_true", help=f"bring the table into {PAGE.name}")
    options = parser.parse_args()
    lines = [f"{today()}, on {machine()}, wall time of {options.rounds} rounds of {options.slots} slots.", ""]
    lines += ["| workers | skill steps a second | s a round | collecting | learning | checkpoint |"]
    lines += ["|---|---|---|---|---|---|"]
    for workers in options.workers:
        print(f"Training with {workers} workers ...", flush=True)
        lines.append(row(workers, train(workers, options.slots, options.rounds)))
    publish("\n".join(lines), BEGIN, write=options.write)


if __name__ == "__main__":
    main()
