"""Algorithm 1 by hand; every registered schema trainer keeps the interface's promises."""

import numpy as np
import pytest

from taskschema.config import SchemaConfig
from taskschema.errors import UnknownNameError
from taskschema.trajectory import Trajectory
from taskschema_learner.schema_trainers import SCHEMA_TRAINERS, make_schema_trainer


def episode(pairs: list[int], *, success: bool) -> Trajectory:
    return Trajectory(
        round=0,
        slot=0,
        episode=0,
        observations=np.zeros((len(pairs), 2), dtype=np.float32),
        pairs=np.array(pairs),
        arguments=np.zeros((len(pairs), 1), dtype=np.float32),
        success=success,
    )


def test_one_update_by_hand() -> None:
    trainer = make_schema_trainer(SchemaConfig(alpha=0.5, beta=0.01))
    start = np.array([[0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.2]])
    batch = [
        episode([0, 1], success=True),  # +0.5 at (0, 0) and (1, 1); its third step never happened
        episode([0, 2, 2], success=False),  # -0.01 at (0, 0), (1, 2), (2, 2)
        episode([1, 1, 2], success=False),  # -0.01 at (0, 1), (1, 1), (2, 2)
        episode([0, 1, 0], success=True),  # +0.5 at (0, 0), (1, 1), (2, 0)
    ]
    result = trainer.update(start, batch)
    np.testing.assert_allclose(
        result,
        [
            [0.5 - 0.01 + 0.5, 0.1 - 0.01, 0.0],
            [0.0, 0.5 - 0.01 + 0.5, -0.01],
            [0.5, 0.0, 0.2 - 0.01 - 0.01],
        ],
    )
    assert start[0, 0] == 0.0


def test_rows_behind_a_success_get_nothing() -> None:
    trainer = make_schema_trainer(SchemaConfig())
    result = trainer.update(np.zeros((3, 9)), [episode([4], success=True)] * 5)
    assert result[0, 4] > 0
    assert not result[1:].any()


@pytest.mark.parametrize("name", sorted(SCHEMA_TRAINERS))
def test_every_trainer(name: str) -> None:
    trainer = make_schema_trainer(SchemaConfig(trainer=name))
    rng = np.random.default_rng(0)
    start = rng.normal(size=(3, 9))
    before = start.copy()
    batch = [episode(rng.integers(9, size=3).tolist(), success=False) for _ in range(40)]
    batch += [episode([1, 2, 3], success=True)]
    result = trainer.update(start, batch)
    assert np.array_equal(start, before)
    assert result.shape == start.shape
    assert np.isfinite(result).all()
    assert np.array_equal(result, trainer.update(start, batch[::-1]))  # order does not matter
    gained = result - start
    assert (gained[range(3), [1, 2, 3]] == gained.max(axis=1)).all()


def test_unknown_trainer_lists_the_valid_ones() -> None:
    with pytest.raises(UnknownNameError, match="algorithm1"):
        make_schema_trainer(SchemaConfig(trainer="algoritm1"))
