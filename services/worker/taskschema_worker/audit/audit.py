"""The audit itself: (a) the expert, (b) the good set, (c) random arguments."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, field
from functools import partial

import numpy as np

from taskschema.errors import ConfigError, UnknownNameError
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.task import GOOD_SHARE, Schema, Task
from taskschema_worker.audit.episodes import BATCH, expert, fixed, run_schema, run_schemas, streams
from taskschema_worker.audit.journal import Journal
from taskschema_worker.audit.report import (
    AuditReport,
    Corner,
    Rate,
    SchemaRate,
    SearchedSchema,
)
from taskschema_worker.audit.search import Found, Search, search_arguments
from taskschema_worker.scene_environment import SceneEnvironment

Progress = Callable[[str, float], None]
"""Called with the part under way and the share of it that is done."""
IDLE = "no_op"
LEAST_ROOM = 1000
"""Numbers that each kind of search has at least: recorded audits are counted with them."""
NEAR_EXPERT = 0.2
"""Spread of a search about the expert's arguments, in units of half a search space."""
EXPERT_PART, CORNER_PART, SCREEN_PART, CONFIRM_PART, RANDOM_PART, SAMPLE_PART, RANDOM_GOOD_PART = range(7)
"""Parts of the audit in the keys of their random streams."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How many episodes each part gets."""

    name: str
    expert: int
    """Random instances for the expert."""
    corner: int
    """Episodes at each corner of the randomisation."""
    screen: int
    """Instances on which every schema is tried with the expert's arguments."""
    confirm: int
    """Instances for schemas that succeed at the screening."""
    random: int
    """Episodes with uniformly random arguments under the paper's schema, and again over all good ones."""
    idle_schemas: int
    """Schemas with one arm idle that are searched; all there are, if fewer."""
    sample_schemas: int
    """Other schemas that are searched."""
    search: Search
    refine: Search
    """Near the expert's arguments, for schemas that those solve in part."""
    skip_repeats: bool = False
    """Whether schemas with one arm idle that differ only in when both arms pause, which takes no time and
    changes nothing, are searched once."""


EFFORTS = {
    effort.name: effort
    for effort in (
        Effort(
            name="quick",
            expert=256,
            corner=16,
            screen=1,
            confirm=40,
            random=2048,
            idle_schemas=4,
            sample_schemas=2,
            search=Search(96, 6, 64),
            refine=Search(32, 2, 40),
        ),
        Effort(
            name="medium",
            expert=1024,
            corner=50,
            screen=3,
            confirm=100,
            random=16384,
            idle_schemas=10_000,
            sample_schemas=8,
            search=Search(96, 5, 100),
            refine=Search(64, 3, 100),
            skip_repeats=True,
        ),
        Effort(
            name="full",
            expert=1024,
            corner=100,
            screen=8,
            confirm=200,
            random=16384,
            idle_schemas=10_000,
            sample_schemas=16,
            search=Search(96, 8, 200),
            refine=Search(96, 4, 200),
        ),
    )
}


def audit(
    task: Task,
    seed: int = 0,
    effort: str = "quick",
    progress: Progress | None = None,
    threads: int = 1,
    journal: Journal | None = None,
) -> AuditReport:
    """Audit a task; the report follows from task, seed and effort alone.

    Args:
        task: a task with a scene.
        seed: of all samples and searches.
        effort: a name in `EFFORTS`.
        progress: called with the part under way and the share of it that is done.
        threads: for the physics; makes no difference to the report.
        journal: what is known already; every part that is counted is added.

    Raises:
        UnknownNameError: if there is no such effort.
        ConfigError: if the task has no scene, and so nothing to audit.
    """
    if not isinstance(task, SceneTask):
        raise ConfigError(f"Task {task.name!r} has no simulated scene to audit: its optimum is known.")
    if effort not in EFFORTS:
        raise UnknownNameError("effort", effort, EFFORTS)
    return audit_with(task, seed, EFFORTS[effort], progress, threads, journal)


def audit_with(
    task: SceneTask,
    seed: int,
    effort: Effort,
    progress: Progress | None = None,
    threads: int = 1,
    journal: Journal | None = None,
) -> AuditReport:
    """Audit a task with sample sizes of one's own; see `audit`."""
    environment = SceneEnvironment(task, threads)
    environment.measure_distance = True
    try:
        told = progress or (lambda part, share: None)
        kept = Journal() if journal is None else journal
        return _Audit(environment, task, seed, effort, told, kept).run()
    finally:
        environment.close()


@dataclass(frozen=True)
class _Audit:
    """One audit under way."""

    environment: SceneEnvironment
    task: SceneTask
    seed: int
    effort: Effort
    progress: Progress
    journal: Journal = field(default_factory=Journal)

    def run(self) -> AuditReport:
        expert_rate, corners = self._expert()
        schemas = list(itertools.product(self.task.pairs.pairs, repeat=self.task.horizon))
        picks = streams(self.seed, SAMPLE_PART, 0, 2)
        idle = [schema for schema in schemas if is_idle(schema) and not self._is_repeat(schema)]
        idle = _choose(idle, self.effort.idle_schemas, picks[0])
        room = max(LEAST_ROOM, len(idle), self.effort.sample_schemas)
        screened = self._refine(self._screen(schemas), 2 * room)
        solved = {item.schema for item in screened}
        good = tuple(item for item in screened if item.rate.value >= GOOD_SHARE)
        rest = [schema for schema in schemas if schema not in solved and not is_idle(schema)]
        return AuditReport(
            task=self.task.name,
            paper_schema=self.task.paper_schema,
            seed=self.seed,
            effort=self.effort.name,
            schema_count=len(schemas),
            expert=expert_rate,
            corners=corners,
            good=good,
            nearly_good=tuple(item for item in screened if 0 < item.rate.value < GOOD_SHARE),
            idle=self._search("one arm idle", idle, 0),
            sample=self._search("other schemas", _choose(rest, self.effort.sample_schemas, picks[1]), room),
            random=self._random([self.task.paper_schema], RANDOM_PART),
            random_good=self._random([item.schema for item in good], RANDOM_GOOD_PART),
        )

    def _expert(self) -> tuple[Rate, tuple[Corner, ...]]:
        self.progress("expert", 0.0)
        rngs = streams(self.seed, EXPERT_PART, 0, self.effort.expert)
        rate = self._expert_rate("expert", [self.task.draw_instance(rng) for rng in rngs])
        corners = []
        for index, name in enumerate(self.task.corner_names):
            rngs = streams(self.seed, CORNER_PART, index, self.effort.corner)
            instances = [self.task.draw_corner(index, rng) for rng in rngs]
            corners.append(Corner(name, self._expert_rate(f"corner {index}", instances)))
        return rate, tuple(corners)

    def _expert_rate(self, part: str, instances: Sequence[ObjectInstance]) -> Rate:
        """Return how often the expert solves instances under the paper's schema."""

        def count() -> list[int]:
            schema = self.task.paper_schema
            outcome = run_schema(self.environment, self.task, schema, instances, expert(self.task))
            return [int(outcome.success.sum())]

        return Rate(self.journal.counts(part, count)[0], len(instances))

    def _screen(self, schemas: Sequence[Schema]) -> list[SchemaRate]:
        """Try every schema with the expert's arguments, and those that succeed at all on more instances."""
        tried = self._rates(schemas, range(len(schemas)), SCREEN_PART, self.effort.screen)
        hopeful = [index for index, rate in enumerate(tried) if rate.successes]
        confirmed = self._rates(schemas, hopeful, CONFIRM_PART, self.effort.confirm)
        return [SchemaRate(schemas[index], rate) for index, rate in zip(hopeful, confirmed, strict=True)]

    def _refine(self, screened: Sequence[SchemaRate], offset: int) -> list[SchemaRate]:
        """Search near the expert's arguments where those solve a schema in part; keep what solves more."""
        size, refined = self.effort.refine, []
        for index, item in enumerate(screened):
            self.progress("schemas solved in part", index / len(screened))
            if 0 < item.rate.value < GOOD_SHARE and not is_idle(item.schema):
                found = self._found(item.schema, offset + index, size, NEAR_EXPERT)
                rate = Rate(found.successes, found.trials)
                if rate.value > item.rate.value:
                    item = SchemaRate(item.schema, rate, searched=True)
            refined.append(item)
        return refined

    def _rates(self, schemas: Sequence[Schema], chosen: Sequence[int], part: int, count: int) -> list[Rate]:
        """Return the success rates of the chosen schemas on `count` instances each, many schemas a batch."""
        name = {SCREEN_PART: "all schemas", CONFIRM_PART: "schemas that succeed"}[part]
        together, rates = max(1, BATCH // count), []
        for start in range(0, len(chosen), together):
            self.progress(name, start / len(chosen))
            solved = partial(self._solved, schemas, chosen[start : start + together], part, count)
            found = self.journal.counts(f"{name} from {start}", solved)
            rates += [Rate(successes, count) for successes in found]
        return rates

    def _solved(self, schemas: Sequence[Schema], indices: Sequence[int], part: int, count: int) -> list[int]:
        """Return of how many instances the expert solves each of the schemas with these indices."""
        rngs = [rng for index in indices for rng in streams(self.seed, part, index, count)]
        instances = [self.task.draw_instance(rng) for rng in rngs]
        repeated = [schemas[index] for index in indices for _ in range(count)]
        outcome = run_schemas(self.environment, self.task, repeated, instances, expert(self.task))
        return [int(row.sum()) for row in outcome.success.reshape(-1, count)]

    def _is_repeat(self, schema: Schema) -> bool:
        """Return whether a schema is searched under another name: the one that pauses at its end."""
        pauses = [pair == (IDLE, IDLE) for pair in schema]
        return self.effort.skip_repeats and pauses != sorted(pauses)

    def _random(self, schemas: Sequence[Schema], part: int) -> Rate:
        """Try uniformly random arguments, new ones for every episode and step, under schemas in turn."""
        self.progress("random arguments", 0.0)
        if not schemas:
            return Rate(0, self.effort.random)

        def count() -> list[int]:
            space, steps = self.task.pairs, len(schemas[0])
            rngs = streams(self.seed, part, 0, self.effort.random)
            instances = [self.task.draw_instance(rng) for rng in rngs]
            raw = np.stack([rng.uniform(-1.0, 1.0, (steps, space.argument_count)) for rng in rngs])
            turns = [schemas[episode % len(schemas)] for episode in range(self.effort.random)]
            outcome = run_schemas(self.environment, self.task, turns, instances, fixed(space.to_si(raw)))
            return [int(outcome.success.sum())]

        return Rate(self.journal.counts(f"random arguments, part {part}", count)[0], self.effort.random)

    def _found(self, schema: Schema, index: int, size: Search, near_expert: float | None = None) -> Found:
        """Search the arguments of one schema; `index` is this search's own number within the audit."""

        def search() -> tuple[int, int, int]:
            task, seed = self.task, self.seed
            return astuple(search_arguments(self.environment, task, schema, seed, index, size, near_expert))

        return Found(*self.journal.counts(f"search {index}", search))

    def _search(self, part: str, schemas: Sequence[Schema], offset: int) -> tuple[SearchedSchema, ...]:
        size = self.effort.search
        searched = []
        for index, schema in enumerate(schemas):
            self.progress(part, index / len(schemas))
            found = self._found(schema, offset + index, size)
            searched.append(
                SearchedSchema(
                    schema,
                    Rate(found.successes, found.trials),
                    found.training_successes,
                    size.population * size.iterations,
                )
            )
        return tuple(searched)


def is_idle(schema: Schema) -> bool:
    """Return whether one arm does nothing throughout."""
    return any(all(pair[arm] == IDLE for pair in schema) for arm in (0, 1))


def _choose(schemas: Sequence[Schema], count: int, rng: np.random.Generator) -> list[Schema]:
    if count >= len(schemas):
        return list(schemas)
    return [schemas[index] for index in sorted(rng.choice(len(schemas), count, replace=False))]
