"""One schema, many objects: `python -m studies.many_objects SCHEMA.json`, each with it and from scratch.

SCHEMA.json is the bar's: `taskschema schema RUN --export SCHEMA.json`. Ctrl-C stops it, and the same command
goes on; what is finished stays finished. The table and what came out of every training go to
`results/many-objects/`, the runs to `runs/many-objects/`.
"""

import argparse
import math
from pathlib import Path
from statistics import median

import msgspec

from taskschema.errors import TaskschemaError
from taskschema_learner.experiment.cell_training import CellTraining
from taskschema_learner.experiment.measurement import source_commit
from taskschema_learner.machine import machine
from taskschema_learner.runs.run_folder import RunFolder

OBJECTS: dict[str, list[str]] = {
    "the bar itself": ["lateral-lifting"],
    "heavy bar": ["--task-file", "docs/examples/carried.py:HeavyBar"],
    "rolling pin": ["--task-file", "docs/examples/carried.py:RollingPin"],
    "tray": ["--task-file", "docs/examples/tray.py:Tray"],
    "box": ["--task-file", "docs/examples/carried.py:Box"],
}
"""What `taskschema train` is told about each object; the schema was learned on the bar."""
TRANSFERRED, FROM_SCRATCH = "transferred", "from scratch"
EPISODES_A_ROUND = 200
TARGET = 0.9


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """What came out of one training, as far as it has come."""

    thing: str
    way: str
    seed: int
    solved: bool
    episodes: int
    minutes: float
    success_last_100: float
    sha256: str
    commit: str

    @property
    def key(self) -> tuple[int, str, str]:
        """What it is the result of."""
        return self.seed, self.thing, self.way


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("schema", type=Path)
    parser.add_argument("--seeds", type=int, default=3, help="seeds 0 to N-1 of every object")
    parser.add_argument("--budget", type=int, default=40_000, help="give up after so many episodes")
    parser.add_argument("--workers", type=int, default=None, help="rollout actors (default: the cores)")
    parser.add_argument("--output", type=Path, default=Path("results/many-objects"))
    parser.add_argument("--runs", type=Path, default=Path("runs/many-objects"))
    options = parser.parse_args()
    training = CellTraining(options.runs.absolute(), options.workers)
    options.output.mkdir(parents=True, exist_ok=True)
    with training.locked():
        train_all(options, training)


def train_all(options: argparse.Namespace, training: CellTraining) -> None:
    """Train what is missing, one after the other, the transferred ones of a seed first."""
    rows = read_rows(options.output)
    for seed in range(options.seeds):
        for way in (TRANSFERRED, FROM_SCRATCH):
            for thing in OBJECTS:
                known = rows.get((seed, thing, way))
                if known is not None and (known.solved or known.episodes >= options.budget):
                    continue
                path = options.runs.absolute() / f"{thing}-{way}-seed{seed}".replace(" ", "-")
                print(f"{thing}, {way}, seed {seed}: at most {options.budget:,} episodes", flush=True)
                good = training.train(arguments(options, thing, way, seed, path))
                row = measure(path, thing, way, seed)
                if row is not None:
                    rows[row.key] = row
                    write(options.output, rows)
                if training.stopped or not good:
                    print("Stopped. The same command goes on.")
                    raise SystemExit(0 if training.stopped else 1)


def arguments(options: argparse.Namespace, thing: str, way: str, seed: int, path: Path) -> list[str]:
    """Return what comes after `taskschema` on the command line; an interrupted run goes on."""
    start = [*OBJECTS[thing], "--seed", str(seed)]
    if way == TRANSFERRED:
        start += ["--init-schema", str(options.schema), "--freeze-schema"]
    if (path / "config.json").exists():
        start = ["--resume"]
    rounds = math.ceil(options.budget / EPISODES_A_ROUND)
    words = ["train", *start, "--rounds", str(rounds), "--run-dir", str(path), "--api", "none"]
    return words if options.workers is None else [*words, "--workers", str(options.workers)]


def measure(path: Path, thing: str, way: str, seed: int) -> Row | None:
    """Return what a run's folder says; None: nothing yet."""
    try:
        metrics = RunFolder.open(path).read_metrics()
    except TaskschemaError:
        return None
    if not metrics:
        return None
    last = metrics[-1]
    seconds = sum(row.seconds_collect + row.seconds_update + row.seconds_checkpoint for row in metrics)
    return Row(
        thing=thing,
        way=way,
        seed=seed,
        solved=last.success_last_100 >= TARGET,
        episodes=last.episodes,
        minutes=round(seconds / 60, 1),
        success_last_100=last.success_last_100,
        sha256=last.sha256,
        commit=source_commit(),
    )


def read_rows(out: Path) -> dict[tuple[int, str, str], Row]:
    """Return what earlier starts wrote down."""
    path = out / "trainings.json"
    if not path.exists():
        return {}
    return {row.key: row for row in msgspec.json.decode(path.read_bytes(), type=list[Row])}


def write(out: Path, rows: dict[tuple[int, str, str], Row]) -> None:
    """Write everything known, and the page."""
    known = [rows[key] for key in sorted(rows)]
    data = msgspec.json.format(msgspec.json.encode(known), indent=1)
    (out / "trainings.json").write_bytes(data + b"\n")
    (out / "README.md").write_text(page(known))


def page(rows: list[Row]) -> str:
    """Return the table in Markdown: episodes to 90 %, medians and how often the schema saves episodes."""
    seeds = sorted({row.seed for row in rows})
    heads = ["object", "schema", *(f"seed {seed}" for seed in seeds), "median", "from scratch / transferred"]
    lines = [
        "# Many objects, one schema: episodes to 90 %",
        "",
        "    python -m studies.many_objects SCHEMA.json",
        "",
        f"On {machine()}, from states.",
        "`transferred`: with the schema of lateral lifting's bar, learned from states and frozen",
        "(`--init-schema SCHEMA.json --freeze-schema`); `from scratch`: schema and arguments learned. `> N`:",
        "not within N episodes so far; -: not trained. `trainings.json` holds everything for a program.",
        "",
        f"| {' | '.join(heads)} |",
        f"|{'---|' * len(heads)}",
    ]
    for thing in OBJECTS:
        medians = {way: _median(rows, thing, way) for way in (TRANSFERRED, FROM_SCRATCH)}
        given, learned = medians[TRANSFERRED], medians[FROM_SCRATCH]
        saved = "" if given is None or learned is None else f"{learned / given:.1f}"
        for way in (TRANSFERRED, FROM_SCRATCH):
            own = {row.seed: row for row in rows if (row.thing, row.way) == (thing, way)}
            cells = [_episodes(own.get(seed)) for seed in seeds]
            middle = medians[way]
            words = [thing, way, *cells, "-" if middle is None else f"{middle:,.0f}"]
            words.append(saved if way == FROM_SCRATCH else "")
            lines.append(f"| {' | '.join(words)} |")
    return "\n".join(lines) + "\n"


def _median(rows: list[Row], thing: str, way: str) -> float | None:
    """Return the median of the solved ones if all are; None: not known."""
    own = [row for row in rows if (row.thing, row.way) == (thing, way)]
    return median(row.episodes for row in own) if own and all(row.solved for row in own) else None


def _episodes(row: Row | None) -> str:
    if row is None:
        return "-"
    if row.solved:
        return f"{row.episodes:,}"
    return f"> {row.episodes:,}"


if __name__ == "__main__":
    main()
