"""Every policy gradient behind the one interface."""

import pytest
import torch
from torch import tensor

from taskschema.config import PPOConfig
from taskschema_learner.algorithms import ALGORITHMS, make_algorithm
from taskschema_learner.batch import Samples


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
    log_probabilities = torch.zeros(4, requires_grad=True)
    batch = samples([1.0, -0.1, -0.1, -0.1], [1.0, 0.0, 0.0, 0.0])
    algorithm.policy_loss(log_probabilities, batch).backward()
    assert log_probabilities.grad is not None
    assert log_probabilities.grad[0] < 0  # descending the loss raises it
    assert (log_probabilities.grad[1:] >= 0).all()
    values = torch.zeros(4, requires_grad=True)
    algorithm.value_loss(values, batch).backward()
    assert values.grad is not None
    assert values.grad[0] < 0
    assert not values.grad[1:].any()
    assert algorithm.epochs >= 1
    assert 0 <= algorithm.gae_lambda <= 1


def test_ppo_by_hand() -> None:
    algorithm = make_algorithm(PPOConfig(advantage_std_floor=0.0))
    # advantages 1, 0 less their mean 0.5, over their standard deviation 0.7071068: 0.7071068, -0.7071068
    # ratios 1.5 and 0.9: min(1.5, 1.2) * 0.7071068 = 0.8485281, min(0.9, 0.9) * -0.7071068 = -0.6363961
    loss = algorithm.policy_loss(tensor([1.5, 0.9]).log(), samples([1.0, 0.0], [1.0, 0.0]))
    assert float(loss) == pytest.approx(-(0.8485281 - 0.6363961) / 2, abs=1e-6)


def test_reinforce_by_hand() -> None:
    algorithm = make_algorithm(PPOConfig(algorithm="reinforce"))
    # -(0.99 * -2.0 + 0.0 * -1.0) / 2 = 0.99
    loss = algorithm.policy_loss(tensor([-2.0, -1.0]), samples([5.0, 5.0], [0.99, 0.0]))
    assert float(loss) == pytest.approx(0.99)
