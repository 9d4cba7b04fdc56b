"""How settings change what the toy task takes to learn: seeds x settings, as a table.

    python -m bench.sweep_toy --processes 2 --write results/toy/sweep.md

Everything runs in this process. A run ends when 90 % of the last 100 episodes succeed, or after
`--rounds` rounds of 200 episodes.
"""

import argparse
import itertools
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from statistics import median

import numpy as np
import torch

from taskschema.arrays import FloatArray, IntArray
from taskschema.config import RunConfig, override
from taskschema.policies import Policy
from taskschema.tasks import Task, get_task
from taskschema.tasks.task import StepResult
from taskschema.tasks.toy import Toy, ToyEnvironment
from taskschema_learner.learner import Learner
from taskschema_worker.rollout import collect_slots

HEADING = """# What the toy task takes to learn

Made by `{command} --write results/toy/sweep.md`. A run ends when 90 % of the last 100 episodes succeed;
a round has 200 episodes; an unsolved run counts with all its rounds. `toy-trap` is the toy with as many
schemas that succeed in at most 20 % of episodes as good ones. The good set is made with the expert's
arguments; the `state` policy has no schema.
"""
GOOD_RATE = 0.95
TRAP_SHARE = 0.2


class TrapEnvironment(ToyEnvironment):
    """The toy, but a bar whose two handles were not grasped in the first step slips in 80 % of episodes."""

    def reset(self, generators: list[np.random.Generator]) -> FloatArray:
        observations = super().reset(generators)
        self._slips = np.array([rng.random() >= TRAP_SHARE for rng in generators])
        self._late = np.zeros(len(generators), dtype=bool)
        return observations

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        first = self._time[episodes] == 0
        self._late[episodes] |= first & (pairs != self._task.paper_pairs[0])
        result = super().step(episodes, pairs, arguments)
        success = result.success & ~(self._late & self._slips)[episodes]
        return StepResult(result.observations, success, result.diverged, result.physics_steps)


class TrapToy(Toy):
    """A toy with as many lucky schemas, which never pass 20 %, as good ones."""

    name = "toy-trap"

    def make_environment(self, threads: int = 1) -> TrapEnvironment:
        return TrapEnvironment(self)


TASKS: dict[str, Task] = {"toy": get_task("toy"), "toy-trap": TrapToy()}


@dataclass(frozen=True)
class Outcome:
    episodes: int | None
    """Episodes to 90 %; None: not reached."""
    found: str
    """`equal` (the known schema), `equivalent` (another good one) or `different`."""


@cache
def good_schemas(task_name: str) -> frozenset[tuple[int, ...]]:
    """Return all schemas that solve 95 % of 200 instances with the expert's arguments."""
    task = TASKS[task_name]
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
        if solved.mean() >= GOOD_RATE:
            good.add(schema)
    return frozenset(good)


def classify(task_name: str, learner: Learner) -> str:
    """Say which schema was found; rows that its successes do not need do not count."""
    used = learner.used_steps or 0
    best = tuple(int(pair) for pair in learner.logits.argmax(axis=1)[:used])
    if best == tuple(TASKS[task_name].paper_pairs):
        return "equal"
    return "equivalent" if any(schema[:used] == best for schema in good_schemas(task_name)) else "different"


def run(task_name: str, config: RunConfig, rounds: int) -> Outcome:
    """Train once."""
    task = TASKS[task_name]
    environment, learner = task.make_environment(), Learner(config, task)
    recent: list[bool] = []
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


def settings() -> list[tuple[str, dict[str, str]]]:
    """Return the task and what differs from the default, for every row of the table."""
    rows: list[tuple[str, dict[str, str]]] = [("toy", {}), ("toy-trap", {})]
    rows += [("toy", {"policy": "oracle"}), ("toy", {"policy": "state"})]
    rows += [("toy", {"schema.alpha": value}) for value in ("0.1", "0.3", "1", "5")]
    rows += [("toy", {"schema.beta": value}) for value in ("5e-5", "2e-4", "1e-3")]
    rows += [("toy-trap", {"schema.alpha": value}) for value in ("1", "5")]
    rows += [("toy", {"network.initial_log_std": "-1.5"}), ("toy", {"ppo.advantage_std_floor": "0"})]
    rows += [("toy", {"ppo.entropy_coefficient": "0"})]
    return rows


def row(item: tuple[str, dict[str, str], int, int]) -> str:
    """Run one row's seeds and return it as Markdown."""
    task_name, differences, seeds, rounds = item
    torch.set_num_threads(1)
    started = time.process_time()
    outcomes = [
        run(task_name, override(RunConfig(task="toy", seed=seed), differences), rounds)
        for seed in range(seeds)
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
    items = [(task, changes, arguments.seeds, arguments.rounds) for task, changes in settings()]
    items = [item for item in items if arguments.rows in f"{item[0]} {item[1]}"]
    with ProcessPoolExecutor(arguments.processes, mp_context=get_context("spawn")) as pool:
        lines = [*head, *pool.map(row, items)]
    if arguments.write is not None:
        arguments.write.parent.mkdir(parents=True, exist_ok=True)
        command = f"python -m bench.sweep_toy --seeds {arguments.seeds} --rounds {arguments.rounds}"
        arguments.write.write_text(f"{HEADING.format(command=command)}\n" + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
