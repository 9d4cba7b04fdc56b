"""How settings change what a task takes to learn: seeds x settings, as a table.

    python -m studies.sweep toy --processes 2 --write results/toy/sweep.md
    python -m studies.sweep lateral-lifting --seeds 3 --rounds 150 --processes 2 \
        --write results/lateral-lifting/sweep.md

A run ends when 90 % of the last 100 episodes succeed, or after `--rounds` rounds of 200 episodes. The
settings of the toy are many, those of a task with physics the ones that the defaults rest on.
"""

import argparse
import itertools
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from statistics import median

import numpy as np
import torch

from studies.toy_trap import TrapToy
from taskschema.config import RunConfig, override
from taskschema.policies import Policy
from taskschema.schema import SchemaView
from taskschema.tasks import Task, get_task
from taskschema.tasks.scene_task import SceneTask
from taskschema.tasks.task import GOOD_SHARE
from taskschema_learner.default_config import default_config
from taskschema_learner.learner import Learner
from taskschema_learner.machine import machine
from taskschema_learner.schemas.schema_report import compare
from taskschema_worker.environments import make_environment
from taskschema_worker.rollout import collect_slots

HEADING = """# What {task} takes to learn under other settings

Made by `{command}` on {machine}. A run ends when
90 % of the last 100 episodes succeed; a round has 200 episodes; an unsolved run counts with all its rounds.
"""
TOY_NOTE = """`toy-trap` is the toy with as many schemas that succeed in at most 20 % of episodes as good
ones. The good set is made with the expert's arguments; the `state` policy has no schema.
"""
EARLIER = {"schema.alpha": "2", "schema.beta": "4e-4"}
"""Defaults before opening was learned: everything that ever succeeds is kept."""
TRAPS: dict[str, type[Task]] = {"toy-trap": TrapToy}
"""Tasks that only this table has."""


@dataclass(frozen=True)
class Outcome:
    episodes: int | None
    """Episodes to 90 %; None: not reached."""
    found: str
    """`equal` (the known schema), `equivalent` (another good one) or `different`."""


def task_named(name: str) -> Task:
    return TRAPS[name]() if name in TRAPS else get_task(name)


@cache
def good_toy_schemas(task_name: str) -> frozenset[tuple[int, ...]]:
    """Return all of a toy's schemas that solve 95 % of 200 instances with the expert's arguments."""
    task = task_named(task_name)
    environment = task.make_environment()
    good = set()
    for schema in itertools.product(range(len(task.pairs)), repeat=task.horizon):
        observations = environment.reset([np.random.default_rng(seed) for seed in range(200)])
        solved = np.zeros(200, dtype=bool)
        for step, pair in enumerate(schema):
            live = np.flatnonzero(~solved)
            arguments = task.expert_arguments(observations[live], step)
            result = environment.step(live, np.full(len(live), pair), arguments)
            observations[live] = result.observations
            solved[live] |= result.success
        if solved.mean() >= GOOD_SHARE:
            good.add(schema)
    return frozenset(good)


def classify(task_name: str, learner: Learner) -> str:
    """Say which schema was found; rows that its successes do not need do not count."""
    task = task_named(task_name)
    if isinstance(task, SceneTask):
        view = SchemaView(task.pairs, learner.logits)
        return str(compare(task, view.best(learner.used_steps)).verdict)
    used = learner.used_steps or 0
    best = tuple(int(pair) for pair in learner.logits.argmax(axis=1)[:used])
    if best == tuple(task.paper_pairs):
        return "equal"
    good = good_toy_schemas(task_name)
    return "equivalent" if any(schema[:used] == best for schema in good) else "different"


def run(task_name: str, config: RunConfig, rounds: int) -> Outcome:
    """Train once."""
    task = task_named(task_name)
    learner = Learner(config, task)
    recent: list[bool] = []
    with closing(make_environment(task, 1, config.observation)) as environment:
        for done in range(rounds):
            slots = collect_slots(
                environment,
                Policy(learner.snapshot(), task.pairs, task.observation),
                seed=config.seed,
                round_index=done,
                slots=range(config.slots),
                episodes_per_slot=config.episodes_per_slot,
                horizon=task.horizon,
            )
            trajectories = [trajectory for slot in slots for trajectory in slot]
            learner.update(trajectories)
            recent = (recent + [item.success for item in trajectories])[-100:]
            if sum(recent) >= 90:
                found = "state" if config.policy == "state" else classify(task_name, learner)
                return Outcome((done + 1) * len(trajectories), found)
    return Outcome(None, "unsolved")


def settings(task: str) -> list[tuple[str, dict[str, str]]]:
    """Return the task and what differs from the default, for every row of the table."""
    if task != "toy":
        rows: list[tuple[str, dict[str, str]]] = [(task, {})]
        rows += [(task, {"schema.alpha": value}) for value in ("1", "2", "8")]
        rows += [(task, {"schema.beta": value}) for value in ("8e-4", "0.002", "0.02")]
        rows += [(task, EARLIER)]
        return rows + [(task, {"network.initial_log_std": value}) for value in ("-0.5", "-1.5")]
    rows = [("toy", {}), ("toy-trap", {})]
    rows += [("toy", {"policy": "oracle"}), ("toy", {"policy": "state"})]
    rows += [("toy", {"schema.alpha": value}) for value in ("0.1", "0.5", "1", "2", "8")]
    rows += [("toy", {"schema.beta": value}) for value in ("8e-4", "0.002", "0.02")]
    rows += [(toy, EARLIER) for toy in ("toy", "toy-trap")]
    rows += [("toy-trap", {"schema.alpha": value}) for value in ("1", "8")]
    rows += [("toy", {"network.initial_log_std": "-1.5"}), ("toy", {"ppo.advantage_std_floor": "0"})]
    rows += [("toy", {"ppo.entropy_coefficient": "0"})]
    return rows


def defaults(task_name: str, seed: int) -> RunConfig:
    """Return the config that a row differs from; tasks of this table alone have the toy's."""
    return RunConfig(task="toy", seed=seed) if "toy" in task_name else default_config(task_name, seed=seed)


def row(item: tuple[str, dict[str, str], int, int]) -> str:
    """Run one row's seeds and return it as Markdown."""
    task_name, differences, seeds, rounds = item
    torch.set_num_threads(1)
    started = time.process_time()
    outcomes = [
        run(task_name, override(defaults(task_name, seed), differences), rounds) for seed in range(seeds)
    ]
    episodes = [outcome.episodes for outcome in outcomes if outcome.episodes is not None]
    found = [outcome.found for outcome in outcomes]
    counts = " ".join(f"{found.count(kind)}" for kind in ("equal", "equivalent", "different"))
    middle = f"{median(outcome.episodes or rounds * 200 for outcome in outcomes):.0f}"
    name = ", ".join(f"{key.split('.')[-1]} {value}" for key, value in differences.items()) or "defaults"
    line = (
        f"| {task_name} | {name} | {len(episodes)}/{seeds} | {middle} | {min(episodes, default='-')} "
        f"| {max(episodes, default='-')} | {counts.replace(' ', ' / ')} "
        f"| {(time.process_time() - started) / seeds:.0f} |"
    )
    print(line, flush=True)
    return line


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("task", help="toy, or a task with physics")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=300)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--rows", default="", help="only rows that contain this text")
    parser.add_argument("--write", type=Path, help="Markdown file for the table")
    arguments = parser.parse_args()
    head = [
        "| task | differs from the default | reached 90 % | median episodes | least | most "
        "| equal / equivalent / different | CPU s a seed |",
        "|---|---|---|---|---|---|---|---|",
    ]
    print("\n".join(head), flush=True)
    items = [(task, changes, arguments.seeds, arguments.rounds) for task, changes in settings(arguments.task)]
    items = [item for item in items if arguments.rows in f"{item[0]} {item[1]}"]
    with ProcessPoolExecutor(arguments.processes, mp_context=get_context("spawn")) as pool:
        lines = [*head, *pool.map(row, items)]
    if arguments.write is not None:
        arguments.write.parent.mkdir(parents=True, exist_ok=True)
        command = f"python -m studies.sweep {arguments.task} --seeds {arguments.seeds}"
        heading = HEADING.format(
            task=arguments.task, command=f"{command} --rounds {arguments.rounds}", machine=machine()
        )
        note = TOY_NOTE if arguments.task == "toy" else ""
        arguments.write.write_text(f"{heading}{note}\n" + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
