"""Train a task with several seeds and write the table: `python -m bench.seeds lateral-lifting --seeds 5`.

Resumable: finished seeds are skipped, an interrupted one goes on. The table, the curves' picture and one
small CSV a seed go to `results/TASK/`; the runs' folders stay in `runs/`.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path
from statistics import median

from taskschema.tasks.registry import task_of
from taskschema_learner.evaluation import evaluate
from taskschema_learner.machine import machine
from taskschema_learner.run_folder import RunFolder
from taskschema_learner.schema_report import compare, schema_words

COMMAND = str(Path(sys.executable).with_name("taskschema"))
EVALUATED = 200
"""Held-out episodes that each trained policy is measured on."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task")
    parser.add_argument("--seeds", type=int, default=5, help="train seeds 0 to N-1")
    parser.add_argument("--rounds", type=int, default=600, help="give up on a seed after so many rounds")
    parser.add_argument("--workers", type=int, default=None, help="rollout actors (default: the cores)")
    arguments = parser.parse_args()
    out = Path("results") / arguments.task
    out.mkdir(parents=True, exist_ok=True)
    for seed in range(arguments.seeds):
        train(arguments.task, seed, arguments.rounds, arguments.workers)
        write_table(out, arguments)


def run_dir(task: str, seed: int) -> Path:
    return Path("runs") / f"{task}-schema-seed{seed}"


def train(task: str, seed: int, rounds: int, workers: int | None) -> None:
    """Train one seed to its end, from wherever it is."""
    path = run_dir(task, seed)
    start = ["--resume", "--run-dir", str(path)] if (path / "config.json").exists() else []
    command = [COMMAND, "train", task, "--seed", str(seed), "--rounds", str(rounds), "--run-dir", str(path)]
    if start:
        command = [COMMAND, "train", *start, "--rounds", str(rounds)]
    if workers is not None:
        command += ["--workers", str(workers)]
    subprocess.run([*command, "--api", "none"], check=True)


def write_table(out: Path, arguments: argparse.Namespace) -> None:
    """Write the table, the curves and the picture of the seeds that are done."""
    rows, paths = [], []
    for seed in range(arguments.seeds):
        path = run_dir(arguments.task, seed)
        if (path / "metrics.csv").exists():
            rows.append(row(path, seed))
            paths.append(str(path))
            shutil.copy(path / "metrics.csv", out / f"seed{seed}.csv")
    reached = [item for item in rows if item["reached"]]
    lines = [
        f"# {arguments.task}: learned from scratch, {len(rows)} seeds",
        "",
        f"`python -m bench.seeds {arguments.task} --seeds {arguments.seeds}` on {machine()}.",
        "Success is counted over the last 100 episodes while training, with sampled actions; training stops",
        "at 90 %. Then the policy is measured on held-out instances, with mean actions (95 % interval).",
        "",
        "| seed | episodes | minutes | success over the last 100 | held out | schema found | is |",
        "|---|---|---|---|---|---|---|",
        *(
            f"| {item['seed']} | {item['episodes']:,} | {item['minutes']:.1f} | {item['success']:.0%} "
            f"| {item['evaluation']} | {item['schema']} | {item['verdict']} |"
            for item in rows
        ),
        "",
    ]
    if reached:
        lines += [
            f"{len(reached)} of {len(rows)} seeds reached 90 %. Median: "
            f"{median(item['episodes'] for item in reached):,.0f} episodes, "
            f"{median(item['minutes'] for item in reached):.1f} minutes.",
            "",
        ]
    lines += ["![learning curves](curves.png)", ""]
    (out / "README.md").write_text("\n".join(lines))
    subprocess.run(
        [COMMAND, "plot", *paths, "--output", str(out / "curves.png")], check=True, capture_output=True
    )


def row(path: Path, seed: int) -> dict[str, object]:
    """Return the facts about one seed."""
    folder = RunFolder.open(path)
    metrics = folder.read_metrics()
    seconds = sum(item.seconds_collect + item.seconds_update + item.seconds_checkpoint for item in metrics)
    comparison = compare(task_of(folder.config), folder.read_schema().best)
    mean = evaluate(folder, EVALUATED).mean
    return {
        "seed": seed,
        "episodes": metrics[-1].episodes,
        "minutes": seconds / 60,
        "success": metrics[-1].success_last_100,
        "reached": metrics[-1].success_last_100 >= 0.9,
        "evaluation": f"{mean.rate:.0%} [{mean.low:.0%}, {mean.high:.0%}]",
        "schema": schema_words(comparison.found),
        "verdict": str(comparison.verdict),
    }


if __name__ == "__main__":
    main()
