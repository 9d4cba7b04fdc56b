"""The packaged good sets, over every task with a scene that has one."""

import json
from importlib import resources

import numpy as np
import pytest

from taskschema.tasks.registry import get_task, task_names
from taskschema.tasks.scene_task import SceneTask
from taskschema_worker.audit.audit import is_idle
from taskschema_worker.audit.episodes import expert, run_schemas
from taskschema_worker.scene_environment import SceneEnvironment

FOLDER = resources.files("taskschema") / "data" / "good_schemas"
EPISODES = 4
SAMPLE = 6


def audited_tasks():
    return [
        name
        for name in task_names()
        if isinstance(get_task(name), SceneTask) and (FOLDER / f"{name}.json").is_file()
    ]


@pytest.fixture(params=audited_tasks())
def task(request):
    return get_task(request.param)


@pytest.fixture
def schemas(task):
    packaged = json.loads((FOLDER / f"{task.name}.json").read_text())
    return [tuple((left, right) for left, right in schema) for schema in packaged]


def test_both_arms_work_in_all_of_them_and_the_paper_s_is_among_them(task, schemas):
    pairs = set(task.pairs.pairs)
    assert all(len(schema) == task.horizon and pairs.issuperset(schema) for schema in schemas)
    assert not any(is_idle(schema) for schema in schemas)
    assert any(schema[: len(task.paper_schema)] == task.paper_schema for schema in schemas)


def test_arms_can_be_exchanged(schemas):
    """Half a turn of the whole scene exchanges the arms; schemas near 95 % may fall to either side of it."""
    exchanged = {tuple((right, left) for left, right in schema) for schema in schemas}
    assert len(exchanged & set(schemas)) >= 0.9 * len(schemas)


def test_seeded_sample_succeeds_with_the_expert_s_arguments(task, schemas):
    rng = np.random.default_rng(0)
    chosen = [schemas[index] for index in rng.choice(len(schemas), min(SAMPLE, len(schemas)), replace=False)]
    environment = SceneEnvironment(task)
    instances = [task.draw_instance(np.random.default_rng(seed)) for seed in range(EPISODES * len(chosen))]
    repeated = [schema for schema in chosen for _ in range(EPISODES)]
    outcome = run_schemas(environment, task, repeated, instances, expert(task))
    environment.close()
    rates = outcome.success.reshape(-1, EPISODES).mean(axis=1)
    assert (rates >= 0.75).all(), dict(zip(chosen, rates, strict=True))
