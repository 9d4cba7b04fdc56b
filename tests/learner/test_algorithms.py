"""Every policy gradient behind the one interface."""

import dataclasses

import pytest
import torch
from torch import tensor

from taskschema.config import PPOConfig
from taskschema_learner.update.algorithms import ALGORITHMS, make_algorithm
from taskschema_learner.update.batch import Samples


def samples(advantages: list[float], returns: list[float]) -> Samples:
    count = len(advantages)
    return Samples(
        inputs=torch.zeros(count, 1),
        pairs=torch.zeros(count, dtype=torch.int64),
        arguments=torch.zeros(count, 1),
        used=torch.ones(count, 1),
        old_log_probabilities=torch.zeros(count),
        old_values=torch.zeros(count),
        advantages=tensor(advantages),
        returns=tensor(returns),
    )


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
def test_every_algorithm_prefers_what_succeeded(name: str) -> None:
    algorithm = make_algorithm(PPOConfig(algorithm=name))
    batch = samples([1.0, -0.1, -0.1, -0.1], [1.0, 0.0, 0.0, 0.0])
    _, by_log_probability = algorithm.policy_loss(torch.zeros(4), batch)
    assert by_log_probability[0] < 0  # descending the loss raises it
    assert (by_log_probability[1:] >= 0).all()
    _, by_value = algorithm.value_loss(torch.zeros(4), batch)
    assert by_value[0] < 0
    assert not by_value[1:].any()
    assert algorithm.epochs >= 1
    assert 0 <= algorithm.gae_lambda <= 1


@pytest.mark.parametrize("name", sorted(ALGORITHMS))
@pytest.mark.parametrize("value_clip", [None, 0.2])
def test_every_written_gradient_is_the_numerical_one(name: str, value_clip: float | None) -> None:
    """By central differences, at random points: none is at an edge of a clip."""
    rng = torch.Generator().manual_seed(3)
    points, old, old_values, advantages, returns = torch.randn(5, 50, generator=rng, dtype=torch.float64)
    algorithm = make_algorithm(PPOConfig(algorithm=name, value_clip=value_clip))
    batch = dataclasses.replace(
        samples([0.0] * 50, [0.0] * 50),
        old_log_probabilities=points + 0.3 * old,
        old_values=points + 0.3 * old_values,
        advantages=advantages,
        returns=returns,
    )
    for loss in (algorithm.policy_loss, algorithm.value_loss):
        _, gradient = loss(points, batch)
        width = 1e-6
        for index, moved in enumerate(width * torch.eye(50, dtype=torch.float64)):
            rise = loss(points + moved, batch)[0] - loss(points - moved, batch)[0]
            assert float(gradient[index]) == pytest.approx(float(rise) / (2 * width), abs=1e-8)


def test_ppo_by_hand() -> None:
    algorithm = make_algorithm(PPOConfig(advantage_std_floor=0.0))
    # advantages 1, 0 less their mean 0.5, over their standard deviation 0.7071068: 0.7071068, -0.7071068
    # ratios 1.5 and 0.9: min(1.5, 1.2) * 0.7071068 = 0.8485281, min(0.9, 0.9) * -0.7071068 = -0.6363961
    loss, gradient = algorithm.policy_loss(tensor([1.5, 0.9]).log(), samples([1.0, 0.0], [1.0, 0.0]))
    assert float(loss) == pytest.approx(-(0.8485281 - 0.6363961) / 2, abs=1e-6)
    # clipped: 0; not clipped: -0.9 * -0.7071068 / 2
    assert gradient.tolist() == pytest.approx([0.0, 0.3181981], abs=1e-6)


def test_reinforce_by_hand() -> None:
    algorithm = make_algorithm(PPOConfig(algorithm="reinforce"))
    # -(0.99 * -2.0 + 0.0 * -1.0) / 2 = 0.99
    loss, gradient = algorithm.policy_loss(tensor([-2.0, -1.0]), samples([5.0, 5.0], [0.99, 0.0]))
    assert float(loss) == pytest.approx(0.99)
    assert gradient.tolist() == pytest.approx([-0.495, 0.0])  # -r / 2
