"""The audit itself: (a) the expert, (b) the good set, (c) random arguments (design section 5)."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from taskschema.errors import ConfigError, UnknownNameError
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.task import GOOD_SHARE, Schema, Task
from taskschema_worker.audit.episodes import BATCH, expert, fixed, run_schema, run_schemas, streams
from taskschema_worker.audit.report import (
    AuditReport,
    Corner,
    Rate,
    SchemaRate,
    SearchedSchema,
)
from taskschema_worker.audit.search import Search, search_arguments
from taskschema_worker.scene_environment import SceneEnvironment

Progress = Callable[[str, float], None]
"""Called with the part under way and the share of it that is done."""
IDLE = "no_op"
NEAR_EXPERT = 0.2
"""Spread of a search about the expert's arguments, in units of half a search space."""
EXPERT_PART, CORNER_PART, SCREEN_PART, CONFIRM_PART, RANDOM_PART, SAMPLE_PART, RANDOM_GOOD_PART = range(7)
"""Parts of the audit in the keys of their random streams."""


@dataclass(frozen=True)
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
        Effort("quick", 256, 16, 1, 40, 2048, 4, 2, Search(96, 6, 64), Search(32, 2, 40)),
        Effort(
            "medium",
            1024,
            50,
            3,
            100,
            16384,
            10_000,
            8,
            Search(96, 5, 100),
            Search(64, 3, 100),
            skip_repeats=True,
        ),
        Effort("full", 1024, 100, 8, 200, 16384, 10_000, 16, Search(96, 8, 200), Search(96, 4, 200)),
    )
}


def audit(
    task: Task,
    seed: int = 0,
    effort: str = "quick",
    progress: Progress | None = None,
    threads: int = 1,
) -> AuditReport:
    """Audit a task; the report follows from task, seed and effort alone.

    Args:
        task: a task with a scene.
        seed: of all samples and searches.
        effort: a name in `EFFORTS`.
        progress: called with the part under way and the share of it that is done.
        threads: for the physics; makes no difference to the report.

    Raises:
        UnknownNameError: if there is no such effort.
        ConfigError: if the task has no scene, and so nothing to audit.
    """
    if not isinstance(task, SceneTask):
        raise ConfigError(f"Task {task.name!r} has no simulated scene to audit: its optimum is known.")
    if effort not in EFFORTS:
        raise UnknownNameError("effort", effort, EFFORTS)
    return audit_with(task, seed, EFFORTS[effort], progress, threads)


def audit_with(
    task: SceneTask, seed: int, effort: Effort, progress: Progress | None = None, threads: int = 1
) -> AuditReport:
    """Audit a task with sample sizes of one's own; see `audit`."""
    environment = SceneEnvironment(task, threads)
    environment.measure_distance = True
    try:
        return _Audit(environment, task, seed, effort, progress or (lambda part, share: None)).run()
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

    def run(self) -> AuditReport:
        expert_rate, corners = self._expert()
        schemas = list(itertools.product(self.task.pairs.pairs, repeat=self.task.horizon))
        screened = self._refine(self._screen(schemas))
        idle = [schema for schema in schemas if is_idle(schema) and not self._is_repeat(schema)]
        solved = {item.schema for item in screened}
        good = tuple(item for item in screened if item.rate.value >= GOOD_SHARE)
        rest = [schema for schema in schemas if schema not in solved and not is_idle(schema)]
        picks = streams(self.seed, SAMPLE_PART, 0, 2)
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
            idle=self._search("one arm idle", _choose(idle, self.effort.idle_schemas, picks[0]), 0),
            sample=self._search("other schemas", _choose(rest, self.effort.sample_schemas, picks[1]), 1000),
            random=self._random([self.task.paper_schema], RANDOM_PART),
            random_good=self._random([item.schema for item in good], RANDOM_GOOD_PART),
        )

    def _expert(self) -> tuple[Rate, tuple[Corner, ...]]:
        self.progress("expert", 0.0)
        rate = self._rate(self.task.paper_schema, EXPERT_PART, 0, self.effort.expert)
        corners = []
        for index, name in enumerate(self.task.corner_names):
            rngs = streams(self.seed, CORNER_PART, index, self.effort.corner)
            instances = [self.task.draw_corner(index, rng) for rng in rngs]
            corners.append(Corner(name, self._expert_rate(self.task.paper_schema, instances)))
        return rate, tuple(corners)

    def _rate(self, schema: Schema, part: int, index: int, count: int) -> Rate:
        instances = [self.task.draw_instance(rng) for rng in streams(self.seed, part, index, count)]
        return self._expert_rate(schema, instances)

    def _expert_rate(self, schema: Schema, instances: Sequence[ObjectInstance]) -> Rate:
        outcome = run_schema(self.environment, self.task, schema, instances, expert(self.task))
        return Rate(int(outcome.success.sum()), len(instances))

    def _screen(self, schemas: Sequence[Schema]) -> list[SchemaRate]:
        """Try every schema with the expert's arguments, and those that succeed at all on more instances."""
        tried = self._rates(schemas, range(len(schemas)), SCREEN_PART, self.effort.screen)
        hopeful = [index for index, rate in enumerate(tried) if rate.successes]
        confirmed = self._rates(schemas, hopeful, CONFIRM_PART, self.effort.confirm)
        return [SchemaRate(schemas[index], rate) for index, rate in zip(hopeful, confirmed, strict=True)]

    def _refine(self, screened: Sequence[SchemaRate]) -> list[SchemaRate]:
        """Search near the expert's arguments where those solve a schema in part; keep what solves more."""
        size, refined = self.effort.refine, []
        for index, item in enumerate(screened):
            self.progress("schemas solved in part", index / len(screened))
            if 0 < item.rate.value < GOOD_SHARE and not is_idle(item.schema):
                found = search_arguments(
                    self.environment, self.task, item.schema, self.seed, 2000 + index, size, NEAR_EXPERT
                )
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
            indices = chosen[start : start + together]
            rngs = [rng for index in indices for rng in streams(self.seed, part, index, count)]
            instances = [self.task.draw_instance(rng) for rng in rngs]
            repeated = [schemas[index] for index in indices for _ in range(count)]
            outcome = run_schemas(self.environment, self.task, repeated, instances, expert(self.task))
            rates += [Rate(int(row.sum()), count) for row in outcome.success.reshape(-1, count)]
        return rates

    def _is_repeat(self, schema: Schema) -> bool:
        """Return whether a schema is searched under another name: the one that pauses at its end."""
        pauses = [pair == (IDLE, IDLE) for pair in schema]
        return self.effort.skip_repeats and pauses != sorted(pauses)

    def _random(self, schemas: Sequence[Schema], part: int) -> Rate:
        """Try uniformly random arguments, new ones for every episode and step, under schemas in turn."""
        self.progress("random arguments", 0.0)
        if not schemas:
            return Rate(0, self.effort.random)
        space, steps = self.task.pairs, len(schemas[0])
        rngs = streams(self.seed, part, 0, self.effort.random)
        instances = [self.task.draw_instance(rng) for rng in rngs]
        raw = np.stack([rng.uniform(-1.0, 1.0, (steps, space.argument_count)) for rng in rngs])
        turns = [schemas[episode % len(schemas)] for episode in range(self.effort.random)]
        outcome = run_schemas(self.environment, self.task, turns, instances, fixed(space.to_si(raw)))
        return Rate(int(outcome.success.sum()), self.effort.random)

    def _search(self, part: str, schemas: Sequence[Schema], offset: int) -> tuple[SearchedSchema, ...]:
        size = self.effort.search
        searched = []
        for index, schema in enumerate(schemas):
            self.progress(part, index / len(schemas))
            found = search_arguments(self.environment, self.task, schema, self.seed, offset + index, size)
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
