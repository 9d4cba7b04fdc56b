"""Equal, equivalent or different."""

import itertools

import msgspec
import numpy as np
import pytest

from taskschema.errors import SchemaMismatchError
from taskschema.schema import BestPair
from taskschema.tasks.registry import get_task, load_task_source
from taskschema_learner.schemas import schema_report
from taskschema_learner.schemas.schema_explanation import explain
from taskschema_learner.schemas.schema_report import SchemaVerdict, compare, good_schemas

PAPER = [("reach", "reach"), ("raise", "raise")]
TASK_FILE = """
from taskschema.tasks.toy import Toy
class Mine(Toy):
    name = "mine"
"""
ONE_EARLY = [("reach", "no_op"), ("no_op", "reach"), ("raise", "raise")]


def best(pairs, used=None):
    return [
        BestPair(step + 1, left, right, 0.9, step < (len(pairs) if used is None else used))
        for step, (left, right) in enumerate(pairs)
    ]


@pytest.fixture
def with_good_schemas(monkeypatch, tmp_path):
    def write(content):
        folder = tmp_path / "data" / "good_schemas"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "toy.json").write_bytes(content)
        monkeypatch.setattr(schema_report.resources, "files", lambda package: tmp_path)

    return write


@pytest.mark.parametrize(
    ("pairs", "used", "verdict"),
    [
        ([*PAPER, ("no_op", "reach")], 2, SchemaVerdict.EQUAL),  # the third step is unused
        ([*PAPER, ("no_op", "reach")], 3, SchemaVerdict.EQUIVALENT),  # begins so, but needs a step more
        (ONE_EARLY, 3, SchemaVerdict.EQUIVALENT),
        (ONE_EARLY, 2, SchemaVerdict.DIFFERENT),  # its first two steps alone solve nothing
        ([("raise", "reach"), ("reach", "raise"), ("no_op", "no_op")], 2, SchemaVerdict.EQUIVALENT),
        ([("raise", "raise"), *PAPER], 3, SchemaVerdict.DIFFERENT),
        ([("no_op", "no_op")] * 3, 0, SchemaVerdict.DIFFERENT),  # never succeeded: nothing is used
    ],
)
def test_a_schema_is_compared_over_the_steps_it_uses(with_good_schemas, pairs, used, verdict):
    # As an audit writes it: a schema of two steps stands there with every third step.
    pairs_of_task = get_task("toy").pairs.pairs
    two_steps = [[("raise", "reach"), ("reach", "raise"), pair] for pair in pairs_of_task]
    with_good_schemas(msgspec.json.encode([[*PAPER, pairs_of_task[0]], ONE_EARLY, *two_steps]))
    comparison = compare(get_task("toy"), best(pairs, used))
    assert comparison.verdict is verdict
    assert comparison.is_success is (verdict is not SchemaVerdict.DIFFERENT)
    assert verdict.value in comparison.sentence


def test_a_verdict_is_explained_step_by_step(with_good_schemas):
    with_good_schemas(msgspec.json.encode([[*PAPER, ("reach", "reach")], ONE_EARLY]))
    task = get_task("toy")

    def words(pairs):
        return explain(task, compare(task, best(pairs)))

    assert words(PAPER) == [
        "Step 1: (reach, reach), as in the paper.",
        "Step 2: (raise, raise), as in the paper.",
        "Equal: every step that is used is the paper's.",
    ]
    step_1, step_2, step_3, reason = words(ONE_EARLY)
    assert step_1 == "Step 1: the right arm runs no_op instead of reach."
    assert (
        step_2
        == "Step 2: the left arm runs no_op instead of raise and the right arm runs reach instead of raise."
    )
    assert step_3 == "Step 3: (raise, raise), one step more than the paper's schema has."
    # The audit found the two above; three steps of nine pairs are 9^3 = 729 schemas.
    assert reason.startswith("Equivalent: ")
    assert reason.endswith("there are 2 among 729.")
    missing, reason = words([("reach", "reach")])[1:]
    assert missing == "Step 2: not there; the paper's schema goes on with (raise, raise)."
    assert reason.startswith("Different: ")


def test_a_task_without_an_audit_is_told_so(with_good_schemas, tmp_path, monkeypatch):
    monkeypatch.setattr(schema_report.resources, "files", lambda package: tmp_path)
    task = get_task("toy")
    advice = "`taskschema audit toy --good-schemas FILE`"
    assert advice in explain(task, compare(task, best(ONE_EARLY)))[-1]
    own = load_task_source("Mine", TASK_FILE)
    advice = "`taskschema audit --task-file FILE:CLASS --good-schemas FILE`"
    assert advice in explain(own, compare(own, best(ONE_EARLY)))[-1]


def test_a_good_set_of_one_s_own_is_read(tmp_path):
    own = load_task_source("Mine", TASK_FILE)
    file = tmp_path / "good.json"
    file.write_bytes(msgspec.json.encode([[*PAPER, ("reach", "reach")], ONE_EARLY]))
    comparison = compare(own, best(ONE_EARLY), file)
    assert comparison.verdict is SchemaVerdict.EQUIVALENT
    assert explain(own, comparison, file)[-1].endswith("there are 2 among 729.")
    with pytest.raises(SchemaMismatchError, match="another task's"):
        compare(get_task("opening"), best(ONE_EARLY), file)
    with pytest.raises(SchemaMismatchError, match="--task-file FILE:CLASS --good-schemas FILE"):
        compare(own, best(ONE_EARLY), tmp_path / "missing.json")


def test_without_a_good_set_only_the_paper_s_schema_is_good(with_good_schemas, tmp_path, monkeypatch):
    monkeypatch.setattr(schema_report.resources, "files", lambda package: tmp_path)
    task = get_task("toy")
    assert good_schemas(task) == [task.paper_schema]
    assert compare(task, best(ONE_EARLY)).verdict is SchemaVerdict.DIFFERENT


def test_a_damaged_good_set_is_refused(with_good_schemas):
    with_good_schemas(b'[["reach"]]')
    with pytest.raises(SchemaMismatchError, match="taskschema audit toy"):
        good_schemas(get_task("toy"))


def test_the_toy_s_good_set_is_what_solves_it():
    """Every schema is tried with exact reaches, and with hands that rise at one step only."""
    task = get_task("toy")
    space, schemas = task.pairs, list(itertools.product(range(len(task.pairs)), repeat=task.horizon))
    solved = np.zeros(len(schemas), dtype=bool)
    for rising_step in range(task.horizon):
        environment = task.make_environment()
        observations = environment.reset([np.random.default_rng(0) for _ in schemas])
        for step in range(rising_step + 1):
            arguments = task.expert_arguments(observations, step)
            for arm in range(2):
                arguments[:, space.columns(arm, 1)] = 0.4 if step == rising_step else 0.0
            pairs = np.array([schema[step] for schema in schemas])
            result = environment.step(np.arange(len(schemas)), pairs, arguments)
            observations = result.observations
            solved |= result.success
    expected = {
        tuple(space.pairs[pair] for pair in schema)
        for schema, good in zip(schemas, solved, strict=True)
        if good
    }
    assert len(expected) > 9
    assert set(good_schemas(task)) == expected | {task.paper_schema}
