"""The audit: its arithmetic by hand, and a seeded sample of it on every family."""

import json
from contextlib import closing
from dataclasses import replace
from importlib import resources
from types import SimpleNamespace

import pytest

from taskschema.errors import ConfigError, UnknownNameError
from taskschema.tasks.registry import get_task
from taskschema_worker.audit import audit
from taskschema_worker.audit.audit import RANDOM_GOOD_PART, Effort, _Audit, audit_with, is_idle
from taskschema_worker.audit.report import AuditReport, Corner, Rate, SchemaRate, SearchedSchema
from taskschema_worker.audit.search import Found, Search, search_arguments
from taskschema_worker.scene_environment import SceneEnvironment

TASK = get_task("lateral-lifting")
GRASP, LIFT = TASK.paper_schema
IDLE_SCHEMA = (("top_grasp", "no_op"), ("lift", "no_op"), ("lift", "no_op"))
LEAST = Effort(
    name="least",
    expert=1,
    corner=1,
    screen=1,
    confirm=1,
    random=1,
    idle_schemas=0,
    sample_schemas=0,
    search=Search(8, 1, 4),
    refine=Search(8, 1, 4),
)
"""Each part once, and no search of its own."""


def report(**changes):
    fields = {
        "task": "lateral-lifting",
        "paper_schema": TASK.paper_schema,
        "seed": 0,
        "effort": "quick",
        "schema_count": 729,
        "expert": Rate(96, 100),
        "corners": (Corner("corner", Rate(9, 10)),),
        "good": tuple(SchemaRate((GRASP, LIFT, pair), Rate(10, 10)) for pair in TASK.pairs.pairs),
        "nearly_good": (),
        "idle": (SearchedSchema(IDLE_SCHEMA, Rate(0, 50), 0, 100),),
        "sample": (),
        "random": Rate(1, 1000),
        "random_good": Rate(5, 1000),
    }
    return AuditReport(**(fields | changes))


class Numbered(_Audit):
    """Notes the number of every search instead of simulating anything."""

    def _expert(self):
        return Rate(1, 1), ()

    def _screen(self, schemas):
        return [SchemaRate(schema, Rate(1, 2)) for schema in schemas if not is_idle(schema)][:3]

    def _random(self, schemas, part):
        return Rate(0, 1)

    def _found(self, schema, index, size, near_expert=None):
        self.journal.append((index, schema))
        return Found(0, 1, 0)


@pytest.mark.parametrize(
    ("idle", "offsets"), [(20, (0, 1000, 2000)), (1000, (0, 1000, 2000)), (1100, (0, 1100, 2200))]
)
def test_no_two_searches_share_a_number_however_many_schemas_there_are(idle, offsets):
    pairs = [("no_op", f"skill {number}") for number in range(idle)]
    pairs += [("grasp", f"skill {number}") for number in range(5)]
    task = SimpleNamespace(
        name="many", horizon=1, paper_schema=(pairs[-1],), pairs=SimpleNamespace(pairs=pairs)
    )
    searches = []
    effort = replace(LEAST, idle_schemas=10_000, sample_schemas=2)
    Numbered(None, task, 0, effort, lambda part, share: None, searches).run()
    first, second, third = offsets
    assert sorted(index for index, _ in searches) == [
        *range(first, first + idle),
        *range(second, second + 2),
        *range(third, third + 3),
    ]


def test_wilson_interval_by_hand():
    # 0 of n: 0 to z^2 / (n + z^2) = 3.8415 / 103.8415.
    low, high = Rate(0, 100).interval
    assert low == 0.0
    assert high == pytest.approx(0.036994, abs=1e-5)
    # 50 of 100: 0.5 +- z / 2 / sqrt(n + z^2).
    assert Rate(50, 100).interval == pytest.approx((0.40383, 0.59617), abs=1e-4)


def test_expected_episodes_by_hand():
    # 729 / (9 x 0.005) = 16,200.
    assert report().expected_episodes == pytest.approx(16_200)
    # 729 / (9 x 0.001) = 81,000, which is not what decides.
    assert report().expected_by_paper_schema == pytest.approx(81_000)
    assert "as hard as the paper's | **no** |" in report().to_markdown()
    assert all(report().verdicts.values())
    assert report(good=()).expected_episodes == float("inf")


@pytest.mark.parametrize(
    "changes",
    [
        {"expert": Rate(94, 100)},
        {"corners": (Corner("good", Rate(10, 10)), Corner("bad", Rate(8, 10)))},
        {"idle": (SearchedSchema(IDLE_SCHEMA, Rate(2, 50), 9, 100),)},
        {"random_good": Rate(4, 1000)},
    ],
)
def test_a_demand_that_is_not_met_is_said(changes):
    failing = report(**changes)
    assert sum(not met for met in failing.verdicts.values()) == 1
    assert "**no**" in failing.to_markdown()


def test_report_reads_back_and_names_the_good_schemas():
    document = json.loads(report().to_json())
    assert document["expected_episodes"] == pytest.approx(16_200)
    good = json.loads(report().good_schemas_json)
    assert len(good) == 9
    assert good[0][:2] == [list(GRASP), list(LIFT)]


def test_tasks_without_a_scene_and_unknown_efforts_are_refused():
    with pytest.raises(ConfigError, match="toy"):
        audit(get_task("toy"))
    with pytest.raises(UnknownNameError, match="full, medium, quick"):
        audit(TASK, effort="fast")


def test_idle_schemas():
    assert is_idle(IDLE_SCHEMA)
    assert not is_idle((("top_grasp", "no_op"), ("lift", "lift"), ("no_op", "no_op")))


@pytest.fixture(scope="module")
def environment():
    environment = SceneEnvironment(TASK, threads=1)
    environment.measure_distance = True
    yield environment
    environment.close()


def test_search_finds_what_can_be_solved(environment):
    """The search that must fail with one arm idle solves most instances with two."""
    found = search_arguments(environment, TASK, TASK.paper_schema, 0, 0, Search(96, 6, 32))
    assert found.training_successes >= 10
    assert found.successes >= 16


def test_a_schema_that_the_expert_solves_in_part_is_searched_near_its_arguments(environment):
    schema = (*TASK.paper_schema, ("no_op", "no_op"))
    effort = replace(LEAST, refine=Search(24, 2, 24))
    sample = _Audit(environment, TASK, 0, effort, lambda part, share: None)
    untouched = [SchemaRate(schema, Rate(24, 24)), SchemaRate(IDLE_SCHEMA, Rate(1, 100))]
    better, *others = sample._refine([SchemaRate(schema, Rate(1, 100)), *untouched], 2000)
    assert better.searched
    assert better.rate.value >= 0.75
    assert others == untouched
    assert "a search's" in report(nearly_good=(better,)).to_markdown()


@pytest.mark.parametrize("left", [True, False])
def test_search_finds_nothing_with_one_arm_idle(environment, left):
    schema = tuple((skill, "no_op") if left else ("no_op", skill) for skill in ("top_grasp", "lift", "lift"))
    found = search_arguments(environment, TASK, schema, 1, 0, Search(64, 4, 32))
    assert found.training_successes == 0
    assert found.successes == 0


def packaged(name):
    """The good schemas that the package holds for a task."""
    file = resources.files("taskschema") / f"data/good_schemas/{name}.json"
    return [tuple(tuple(pair) for pair in schema) for schema in json.loads(file.read_text())]


@pytest.mark.parametrize(
    ("name", "random"), [("lateral-lifting", 1024), ("picking", 128), ("opening", 0), ("rotating", 512)]
)
def test_seeded_sample_of_the_audit(name, random):
    """(a), and (c) where a few hundred episodes hold a success; the whole audits are in results/audit."""
    task, good = get_task(name), packaged(name)
    effort = replace(LEAST, expert=32, corner=2, random=random)
    with closing(SceneEnvironment(task, threads=1)) as environment:
        sample = _Audit(environment, task, 0, effort, lambda part, share: None)
        expert, corners = sample._expert()
        found = {"random_good": sample._random(good, RANDOM_GOOD_PART)} if random else {}
    assert len(corners) == 8
    sampled = report(
        schema_count=len(task.pairs) ** task.horizon,
        expert=expert,
        corners=corners,
        good=tuple(SchemaRate(schema, Rate(1, 1)) for schema in good),
        **found,
    )
    assert all(sampled.verdicts.values()), sampled.verdicts


def test_packaged_good_set_holds_with_the_expert_s_arguments(environment):
    schemas = packaged("lateral-lifting")
    assert (GRASP, LIFT, ("no_op", "no_op")) in schemas
    assert not any(is_idle(schema) for schema in schemas)
    effort = replace(LEAST, screen=2, confirm=8)
    sample = _Audit(environment, TASK, 3, effort, lambda part, share: None)
    staged = [schema for schema in schemas if schema[:2] != TASK.paper_schema][::4]
    screened = sample._screen(staged)
    assert [item.schema for item in screened] == staged
    assert all(item.rate.value >= 0.75 for item in screened)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_whole_quick_audit_is_repeatable():
    effort = replace(
        LEAST,
        expert=16,
        corner=2,
        confirm=4,
        random=64,
        idle_schemas=1,
        sample_schemas=1,
        search=Search(16, 2, 4),
    )
    first, second = (audit_with(TASK, 0, effort, threads=threads) for threads in (1, 2))
    assert first == second
