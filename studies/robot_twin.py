"""Train on the twin as on robots, for a table: `python -m studies.robot_twin lateral-lifting heavy-bar`.

Starts `taskschema train --agent robot` and `taskschema-robot run --twin own`, over real sockets and a real
Redis, until 90 % success, `--rounds` or Ctrl-C. Resumable: the same command goes on with what was done, and
`--report` alone writes what there is so far. Results go to `results/robot-twin/`; the run's folder and the
agent's log stay in `runs/robot-twin/`.
"""

import argparse
import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from taskschema_learner.machine import machine
from taskschema_learner.runs.run_folder import RunFolder

RUNS, OUT = Path("runs/robot-twin"), Path("results/robot-twin")
FROM_SIMULATION = "-from-simulation"
"""Ends the names of runs that start from a policy."""
PAPER_SKILL_SECONDS = 12.6
"""The paper's robots: 2,000 skills in 6 to 8 hours (Figure 7)."""
ROWS = 300
"""Kept of each curve."""
START_SECONDS = 120.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", help="a task, or FILE:CLASS of one")
    parser.add_argument("object")
    parser.add_argument(
        "--init-schema", help="schema or run to transfer (default: the paper's schema, given)"
    )
    parser.add_argument(
        "--init-policy", help="policy or run to start from, beyond the paper (default: random weights)"
    )
    parser.add_argument("--set", action="append", default=[], help="passed on to `taskschema train`")
    parser.add_argument("--rounds", type=int, help="give up after so many rounds")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--see", choices=("truth", "camera"), default="truth", help="camera: the reward from markers"
    )
    parser.add_argument("--report", action="store_true", help="train nothing: write what there is so far")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if not arguments.report:
        started = FROM_SIMULATION if arguments.init_policy else ""
        train(arguments, RUNS / f"{arguments.object}{started}")
    write_results()


def train(arguments: argparse.Namespace, folder: Path) -> None:
    """Run twin, learner and agent until the run is over."""
    RUNS.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("MUJOCO_GL", "egl")
    learner = subprocess.Popen(_train_command(arguments, folder))
    try:
        _wait_for(folder / "redis" / "redis.conf", learner)
        while learner.poll() is None:  # the agent is started again should it end before the run does
            _serve_until_over(_serve_command(arguments, folder), learner)
    except KeyboardInterrupt:
        print("Stopped; the same command goes on.")
    finally:
        learner.send_signal(signal.SIGTERM)
        learner.wait()


def _serve_command(arguments: argparse.Namespace, folder: Path) -> list[str]:
    serve = [sys.executable, "-c", "from taskschema_robot.cli.main import main; main()", "run", str(folder)]
    options = ["--object", arguments.object, "--twin", "own", "--see", arguments.see, "--speed-ratio", "1.0"]
    return [*serve, *options, "--rate", "50", "--unattended", "--folder", str(RUNS / "agent")]


def _serve_until_over(command: list[str], learner: subprocess.Popen[bytes]) -> None:
    agent = subprocess.Popen(command)
    try:
        while agent.poll() is None and learner.poll() is None:
            time.sleep(1.0)
    finally:
        agent.send_signal(signal.SIGTERM)
        agent.wait()


def _train_command(arguments: argparse.Namespace, folder: Path) -> list[str]:
    command = [sys.executable, "-m", "taskschema_learner", "train", "--agent", "robot", "--api", "none"]
    if arguments.rounds is not None:
        command += ["--rounds", str(arguments.rounds)]
    if (folder / "config.json").exists():
        return [*command, "--resume", "--run-dir", str(folder)]
    command += ["--task-file", arguments.task] if ":" in arguments.task else [arguments.task]
    command += ["--run-dir", str(folder), "--seed", str(arguments.seed)]
    for assignment in arguments.set:
        command += ["--set", assignment]
    if arguments.init_policy is not None:
        command += ["--init-policy", arguments.init_policy]
    if arguments.init_schema is None:
        return [*command, "--policy", "oracle"]
    return [*command, "--init-schema", arguments.init_schema, "--freeze-schema"]


def _wait_for(path: Path, learner: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + START_SECONDS
    while not path.exists():
        if learner.poll() is not None or time.monotonic() > deadline:
            raise SystemExit("The learner did not start: see what it says above.")
        time.sleep(0.5)
    time.sleep(2.0)  # Redis reads its file, the learner registers its run


COLUMNS = (
    "object",
    "schema",
    "first weights",
    "update",
    "episodes",
    "successes",
    "updates",
    "skills",
    "refused",
    "dropped",
    "hours",
    "paper's",
    "first 100",
    "last 100",
)
INTRODUCTION = """\
# Training on the twin, as on robots

`python -m studies.robot_twin TASK OBJECT` on {machine}. One agent drives two simulated
Sawyers over rosbridge in lock-step, in rounds of 167 episodes. `update` is the learning rate, and
minibatches x epochs of the update after each; the paper's for robots is 0.005, 10 x 10 (section IV-D). The
policy sees states, by the twin's own word.
`first 100` is success over the first 100 episodes, before any update: for a network that starts from a policy
that was trained in simulation (with `--safety-gate`), what the twin makes of that. The paper transfers the
schema only; the rows with `random` weights do as it does. `dropped` tries were ended by a fault, mostly a
hand that pressed with more than 80 N; they are run again and count neither way. On robots a person would have
acknowledged each. `skills` are each arm's that is not a no-op, `refused` steps included.
Hours are on the twin's clock, at the arms' full speed; beside them (paper's) the same skills at the paper's
pace of {pace:g} s each (2,000 skills in 6 to 8 hours). The paper's real runs took 4 to 10 hours.
Skills and hours include those of dropped tries and of the ways home after them; a row marked {mark} was
measured before they were counted, and its skills and hours are those of the episodes that count.

"""
"""Of the table: `refused` are steps that the gate refused, `dropped` tries that a fault ended."""
UNCOUNTED = "*"
"""Marks rows whose agent kept no record of what dropped tries took."""
SIMULATION = """
## In simulation, with the gate

Where the policies of the rows above come from: `taskschema train TASK --policy oracle --safety-gate
--init-policy RUN --until-success 0.97 --run-dir runs/robot-twin/simulated/OBJECT`, in rounds of 200
episodes and with the settings of simulation; for the water bottle with `--init-schema RUN --freeze-schema`
instead of `--policy oracle`. For heavy bar and water bottle RUN was one without the gate that learned its
schema: `taskschema train lateral-lifting --seed 1`, `taskschema train opening`. For the rolling pin
(`--task-file docs/examples/carried.py:RollingPin`) it was the heavy bar's with the gate.

| object | first weights | episodes | first round | last 100 | refused, first round | refused, last round |
|---|---|---|---|---|---|---|
"""
SIMULATED = "simulated"
"""Folder of those runs, below `RUNS`."""
UNFINISHED = """
**Not finished**: {names} did not reach 90 % of the last 100. What stands here is how far the run has come,
not what it ends at. The same command goes on with it where its `runs/robot-twin` lies; elsewhere it starts
again.
"""


@dataclass(frozen=True)
class Curve:
    """One object's training, as its agent counted it."""

    name: str
    rows: list[dict[str, str]]
    dropped: list[dict[str, str]]
    """Tries that do not count; empty if the agent did not write them down."""

    @property
    def skills(self) -> float:
        return self.total("skills") + sum(float(row["skills"]) for row in self.dropped)

    @property
    def hours(self) -> float:
        return max((float(row["hours"]) for row in [*self.rows[-1:], *self.dropped[-1:]]), default=0.0)

    @property
    def mark(self) -> str:
        return UNCOUNTED if self.total("attempt") > len(self.dropped) else ""

    def total(self, column: str) -> float:
        return sum(float(row[column]) for row in self.rows)

    @property
    def first_100(self) -> float:
        return _success(self.rows[:100])

    @property
    def last_100(self) -> float:
        return _success(self.rows[-100:])


def _success(rows: list[dict[str, str]]) -> float:
    return sum(row["success"] == "1" for row in rows) / max(len(rows), 1)


def write_results() -> None:
    """Write table and thinned curves of every training whose folder is here, and the picture of all curves.

    Where there is none, the page stays as it is.
    """
    OUT.mkdir(parents=True, exist_ok=True)
    curves = []
    for path in sorted((RUNS / "agent").glob("*/episodes.csv")):
        dropped = path.with_name("dropped.csv")
        curves.append(Curve(path.parent.name, _rows(path), _rows(dropped) if dropped.exists() else []))
    for curve in curves:
        step = max(1, len(curve.rows) // ROWS)
        with (OUT / f"{curve.name}.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["episode", "hours", "success_last_100"])
            for number in range(0, len(curve.rows), step):
                row = curve.rows[number]
                writer.writerow([number + 1, row["hours"], row["last_100"]])
    if curves:
        (OUT / "README.md").write_text(_table(curves))
    _draw({path.stem: _rows(path) for path in sorted(OUT.glob("*.csv"))})


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def _simulated() -> list[str]:
    """Return the table of what was trained in simulation before, with the robot's gate."""
    paths = sorted((RUNS / SIMULATED).glob("*/config.json"))
    lines = SIMULATION.splitlines() if paths else []
    for path in paths:
        folder = RunFolder.open(path.parent)
        rows = folder.read_metrics()
        before = [0, *(row.steps for row in rows)]
        first, last = (rows[i].refused / (before[i + 1] - before[i]) for i in (0, len(rows) - 1))
        start = "random" if folder.config.initial_policy is None else "another run's"
        lines.append(
            f"| {folder.name} | {start} | {rows[-1].episodes:,} | {rows[0].success_rate:.1%} "
            f"| {rows[-1].success_last_100:.0%} | {first:.0%} | {last:.0%} |"
        )
    return lines


def _table(curves: list[Curve]) -> str:
    lines = INTRODUCTION.format(machine=machine(), pace=PAPER_SKILL_SECONDS, mark=UNCOUNTED).splitlines()
    lines += [_line(COLUMNS), _line(["---"] * len(COLUMNS))]
    for curve in curves:
        config = RunFolder.open(RUNS / curve.name).config
        schema = "the paper's, given" if config.policy == "oracle" else "transferred, frozen"
        updates = len(RunFolder.open(RUNS / curve.name).read_metrics())
        first = "random" if config.initial_policy is None else "simulation's"
        cells = (
            curve.name.removesuffix(FROM_SIMULATION) + curve.mark,
            schema,
            first,
            f"{config.ppo.learning_rate:g}, {config.ppo.minibatches} x {config.ppo.epochs}",
            f"{len(curve.rows):,}",
            f"{curve.total('success'):,.0f}",
            f"{updates}",
            f"{curve.skills:,.0f}",
            f"{curve.total('refused'):,.0f}",
            f"{curve.total('attempt'):,.0f}",
            f"{curve.hours:.1f}",
            f"{curve.skills * PAPER_SKILL_SECONDS / 3600:.1f}",
            f"{curve.first_100:.0%}",
            f"{curve.last_100:.0%}",
        )
        lines.append(_line(cells))
    open_ended = [_words(curve.name) for curve in curves if curve.last_100 < 0.9]
    if open_ended:
        lines += UNFINISHED.format(names=", ".join(open_ended)).splitlines()
    return "\n".join([*lines, *_simulated(), "", "![success against hours](curves.png)", ""])


def _words(name: str) -> str:
    start = "a policy of simulation" if name.endswith(FROM_SIMULATION) else "random weights"
    return f"{name.removesuffix(FROM_SIMULATION)} from {start}"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _draw(curves: dict[str, list[dict[str, str]]]) -> None:
    """Draw thinned curves, by name."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for name, rows in curves.items():
        hours, success = ([float(row[column]) for row in rows] for column in ("hours", "success_last_100"))
        axes.plot(hours, success, label=_words(name))
    axes.axhline(0.9, color="gray", lw=0.8, ls="--")
    axes.set_xlabel("hours on the twin's clock")
    axes.set_ylabel("success over the last 100 episodes")
    axes.set_ylim(0, 1)
    if curves:
        axes.legend()
    figure.savefig(OUT / "curves.png", dpi=110)


if __name__ == "__main__":
    main()
