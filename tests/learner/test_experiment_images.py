"""The experiment on images: its cells are what `taskschema train` makes of their options."""

import msgspec
import numpy as np
import pytest

from taskschema.errors import ExperimentError
from taskschema.schema import SchemaView
from taskschema.tasks.toy import Toy
from taskschema_learner.cli.train import _with_options
from taskschema_learner.default_config import default_config
from taskschema_learner.experiment.cell import Cell
from taskschema_learner.experiment.plan import Plan
from taskschema_learner.experiment.recipe import ImagesSim, PaperSim

LOGITS = np.arange(27.0).reshape(3, 9)


@pytest.fixture
def recipe(tmp_path):
    view = SchemaView(Toy().pairs, LOGITS)
    document = view.document(run="bar", task="toy", version=7, used_steps=2, updated_at="then")
    (tmp_path / "toy.json").write_bytes(msgspec.json.encode(document))
    return ImagesSim(tmp_path)


def config_of_options(cell, words):
    """What the command makes of these options, which come in pairs but for the last."""
    given = {"task": cell.task, "seed": cell.seed}
    for index, word in enumerate(words):
        if word.startswith("--"):
            is_flag = index + 1 == len(words) or words[index + 1].startswith("--")
            given[word[2:].replace("-", "_")] = True if is_flag else words[index + 1]
    return _with_options(default_config(cell.task, "schema"), given)


@pytest.mark.parametrize("policy", ["transferred", "re-learned"])
def test_options_give_the_config_that_results_are_kept_for(recipe, policy):
    cell = Cell("toy", policy, 2)
    config = recipe.config(cell)
    assert config == config_of_options(cell, recipe.options(cell))
    assert config.observation == "image"
    assert config.schema.frozen == (policy == "transferred")
    if policy == "transferred":
        assert np.array_equal(config.schema.initial_logits, LOGITS)


def test_states_are_as_they_were():
    cell = Cell("toy", "oracle", 1)
    assert PaperSim().config(cell) == default_config("toy", "oracle", 1)
    assert PaperSim().options(cell) == ["--policy", "oracle"]


def test_a_missing_schema_says_how_to_make_it(tmp_path):
    with pytest.raises(ExperimentError, match=r"schema RUN --export .*opening\.json"):
        ImagesSim(tmp_path).config(Cell("opening", "transferred", 0))


def test_the_matrix_alternates_what_is_compared():
    cells = Plan(("a", "b"), ("transferred", "re-learned"), 1).cells()
    assert [(cell.task, cell.policy) for cell in cells] == [
        ("a", "transferred"),
        ("a", "re-learned"),
        ("b", "transferred"),
        ("b", "re-learned"),
    ]
