"""How many episodes a family needs from images: `python -m studies.images_budget [TASK ...] [--write]`.

From images an arm's locations are places on the table, and a pose's height is the skill's own. Which of the
audit's good schemas hold there too is tried with the scripted expert's arguments, brought into that search
space; how rare a success with random arguments is under them, as an audit measures it on states. Both
together give the episodes to a first success, and these the budget. Nothing is rendered: neither looks.
"""

import argparse
import json
import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studies.first_success import RandomArguments, anchors_of
from taskschema.arrays import FloatArray
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.table_arguments import offset_arguments
from taskschema.tasks.task import GOOD_SHARE, Schema
from taskschema_learner.evaluation import SuccessRate, wilson
from taskschema_learner.experiment.plan import PAPER_TASKS
from taskschema_learner.machine import machine
from taskschema_learner.schemas.schema_report import good_schemas
from taskschema_worker.audit.episodes import run_schemas
from taskschema_worker.scene_environment import SceneEnvironment

PAGE = Path("results/images-sim/budget.md")
SUMMARY = Path("results/paper-sim/summary.json")
"""Where the episodes are that seeds on states take to 90 %."""
MARGIN = 1.5
"""Times the episodes that are to be expected."""
HEAD = """# How many episodes each family needs from images

`python -m studies.images_budget --trials {trials} --episodes {episodes} --write` on {machine}.

*Hold*: good schemas of the audit that solve 95 % of {trials} instances with the expert's arguments brought to
places on the table, too. *p*: successes with uniformly random arguments over those that hold, {episodes}
episodes. *First success*: schemas / (those that hold x p), for a schema that is learned. *Slowest on states*:
seed of `schema` in [paper-sim](../paper-sim/README.md). *Budget*: {margin} x (first success + slowest).

| task | schemas | good | hold | p | 95 % interval | first success | slowest on states | budget |
|---|---|---|---|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Needs:
    """What was measured of one family."""

    task: SceneTask
    good: int
    hold: int
    random: SuccessRate

    def row(self, slowest: int) -> str:
        """Return the row of the table; `slowest`: episodes of the slowest seed on states."""
        count = len(self.task.pairs.pairs) ** self.task.horizon
        first = count / (self.hold * self.random.rate) if self.hold and self.random.rate else math.inf
        budget = MARGIN * (first + slowest)
        cells = [
            self.task.name,
            f"{count:,}",
            f"{self.good}",
            f"{self.hold}",
            f"{self.random.rate:.3%}",
            f"{self.random.low:.3%} to {self.random.high:.3%}",
            _episodes(first),
            f"{slowest:,}",
            _episodes(budget),
        ]
        return f"| {' | '.join(cells)} |"


def main() -> None:
    """Print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", metavar="TASK", default=PAPER_TASKS)
    parser.add_argument("--trials", type=int, default=40, help="instances for every good schema")
    parser.add_argument("--episodes", type=int, default=4096, help="episodes with random arguments")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE}")
    options = parser.parse_args()
    if options.write and tuple(options.tasks) != PAPER_TASKS:
        parser.error("--write needs all families: name none.")
    text = HEAD.format(machine=machine(), trials=options.trials, episodes=options.episodes, margin=MARGIN)
    print(text, end="", flush=True)
    for name in options.tasks:
        row = measure(name, options.trials, options.episodes).row(slowest_on_states(name))
        print(row, flush=True)
        text += row + "\n"
    if options.write:
        PAGE.write_text(text)


def measure(name: str, trials: int, episodes: int) -> Needs:
    """Return what a family needs."""
    task = get_task(name)
    assert isinstance(task, SceneTask)
    schemas = [schema for schema in good_schemas(task) if len(schema) == task.horizon]
    environment = SceneEnvironment(task, os.cpu_count() or 1)
    try:
        hold = schemas_that_hold(environment, task, schemas, trials)
        successes = random_successes(environment, task, hold, episodes) if hold else 0
    finally:
        environment.close()
    return Needs(task, len(schemas), len(hold), wilson(successes, episodes))


def schemas_that_hold(
    environment: SceneEnvironment, task: SceneTask, schemas: list[Schema], trials: int
) -> list[Schema]:
    """Return the schemas that the expert solves from places on the table."""
    instances = _instances(task, 0, trials)
    repeated = [schema for schema in schemas for _ in instances]

    def arguments(observations: FloatArray, step: int, part: slice) -> FloatArray:
        return from_table(task, task.expert_arguments(observations, step), observations)

    found = run_schemas(environment, task, repeated, instances * len(schemas), arguments)
    rates = found.success.reshape(len(schemas), trials).mean(axis=1)
    return [schema for schema, rate in zip(schemas, rates, strict=True) if rate >= GOOD_SHARE]


def from_table(task: SceneTask, arguments: FloatArray, observations: FloatArray) -> FloatArray:
    """Return arguments [N, A] as a policy on images could have chosen them: inside its search space."""
    anchors = anchors_of(task, observations)
    table, names = task.image_pairs, task.pairs.argument_names
    columns = []
    for name in table.argument_names:
        column, argument = arguments[:, names.index(name)], name.rpartition(".")[2]
        columns.append(column + anchors[:, "xy".index(argument)] if argument in ("x", "y") else column)
    inside = table.to_si(table.to_normalised(np.stack(columns, axis=1)))
    return offset_arguments(task, inside, anchors)


def random_successes(
    environment: SceneEnvironment, task: SceneTask, schemas: list[Schema], episodes: int
) -> int:
    """Return how many of these episodes with random arguments succeed, under the schemas in turn."""
    source = RandomArguments(task, generator(EpisodeKey(0, 1, 0, 0), Purpose.AUDIT), True, False)
    turns = [schemas[episode % len(schemas)] for episode in range(episodes)]
    found = run_schemas(environment, task, turns, _instances(task, 1, episodes), source)
    return int(found.success.sum())


def _instances(task: SceneTask, part: int, count: int) -> list[ObjectInstance]:
    return [task.draw_instance(generator(EpisodeKey(0, 0, part, n), Purpose.AUDIT)) for n in range(count)]


def slowest_on_states(task: str) -> int:
    """Return the episodes of the slowest seed of `schema` that solved a task on states."""
    cells = json.loads(SUMMARY.read_text())["cells"]
    own = [c for c in cells if (c["task"], c["policy"], c["state"]) == (task, "schema", "solved")]
    return max(cell["episodes"] for cell in own)


def _episodes(count: float) -> str:
    return f"{math.ceil(count / 100) * 100:,}" if math.isfinite(count) else "not known"


if __name__ == "__main__":
    main()
