"""When a schema is given up, by hand and in a learner."""

import numpy as np
import pytest

from taskschema.config import RunConfig, override
from taskschema.errors import ConfigError
from taskschema.tasks import get_task
from taskschema.trajectory import Trajectory
from taskschema_learner.learner import Learner
from taskschema_learner.schema_trainers import Patience

CERTAIN = np.array([[9.0, 0.0, 0.0], [0.0, 9.0, 0.0]])
EVEN = np.zeros((2, 3))


def rounds_until_given_up(
    patience: Patience, successes: list[int], logits: np.ndarray = CERTAIN
) -> int | None:
    for number, count in enumerate(successes, start=1):
        if patience.is_exhausted(logits, count, 200):
            return number
    return None


def test_luck_that_stays_what_it_is_is_given_up() -> None:
    assert rounds_until_given_up(Patience(6), [1, 2, 1, 1, 2, 1]) == 6
    assert rounds_until_given_up(Patience(6), [0] * 6) is None  # 0 >= 1.3 * 0: nothing was tried in vain yet


def test_a_schema_that_becomes_better_stays_until_it_no_longer_does() -> None:
    patience = Patience(6)
    assert rounds_until_given_up(patience, [1, 2, 1, 2, 2, 2, 3, 4, 5, 6]) is None
    assert rounds_until_given_up(patience, [6, 6, 6, 6, 6, 6]) == 3


def test_a_schema_that_is_good_enough_stays() -> None:
    assert rounds_until_given_up(Patience(6), [180] * 20) is None
    assert rounds_until_given_up(Patience(6), [99] * 20) == 6


def test_while_the_rows_are_undecided_nothing_is_on_trial() -> None:
    patience = Patience(4)
    assert rounds_until_given_up(patience, [1] * 30, EVEN) is None
    assert rounds_until_given_up(patience, [1] * 3) is None
    assert rounds_until_given_up(patience, [1], EVEN) is None  # the trial ends
    assert rounds_until_given_up(patience, [1] * 4) == 4


def test_no_patience_is_the_papers() -> None:
    assert rounds_until_given_up(Patience(0), [1] * 50) is None


def test_a_trial_goes_on_where_it_was_interrupted() -> None:
    first = Patience(6)
    assert rounds_until_given_up(first, [1, 2, 1, 1]) is None
    second = Patience(6)
    second.load(first.arrays())
    assert rounds_until_given_up(second, [2, 1]) == 2
    assert (first.given_up, second.given_up) == (0, 1)


def episodes(round_index: int, wins: int) -> list[Trajectory]:
    """Return a round of the toy in which one schema now and then succeeds."""
    task = get_task("toy")
    rng = np.random.default_rng(round_index)
    return [
        Trajectory(
            round=round_index,
            slot=number,
            episode=0,
            observations=rng.normal(size=(task.horizon, task.observation.size)).astype(np.float32),
            pairs=np.array([1, 2, 3][: task.horizon]),
            arguments=rng.normal(size=(task.horizon, task.pairs.argument_count)).astype(np.float32),
            success=number < wins,
        )
        for number in range(20)
    ]


def test_a_learner_starts_over_from_its_first_logits() -> None:
    config = override(RunConfig(task="toy"), {"schema.patience": "4"})
    learner = Learner(config, get_task("toy"))
    for round_index in range(2):
        learner.update(episodes(round_index, wins=2))
    assert learner.logits.max() > 3
    resumed = Learner(config, get_task("toy"))
    resumed.restore(learner.arrays())
    for each in (learner, resumed):
        for round_index in range(2, 5):
            each.update(episodes(round_index, wins=1))
        assert not each.logits.any()
        assert each.schemas_given_up == 1


def test_a_checkpoint_without_the_trial_is_refused() -> None:
    learner = Learner(RunConfig(task="toy"), get_task("toy"))
    arrays = learner.arrays()
    del arrays["patience.successes"]
    with pytest.raises(ConfigError, match="does not fit"):
        learner.restore(arrays)


def test_a_negative_patience_is_refused() -> None:
    with pytest.raises(ConfigError, match="patience"):
        override(RunConfig(task="toy"), {"schema.patience": "-1"})
