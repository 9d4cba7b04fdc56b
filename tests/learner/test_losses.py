"""Losses by hand, densities and entropies against numerical integration and enumeration."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import tensor

from taskschema.skills.pairs import PairSpace
from taskschema.tasks import get_task
from taskschema_learner.update.losses import (
    argument_terms,
    clipped_policy_loss,
    clipped_value_loss,
    normalise,
    pair_entropy,
    pair_log_probability,
)

PAIRS: PairSpace = get_task("toy").pairs
number = st.floats(-1.0, 1.0)


def log_probability(
    pair: tuple[str, str], arguments: torch.Tensor, mean: torch.Tensor, log_std: torch.Tensor
) -> float:
    used = torch.from_numpy(PAIRS.used[[PAIRS.index(*pair)]]).double()
    return float(argument_terms(arguments[None], mean[None], log_std[None], used)[0])


def entropy(pair: tuple[str, str], log_std: torch.Tensor) -> float:
    used = torch.from_numpy(PAIRS.used[[PAIRS.index(*pair)]]).double()
    return float(
        argument_terms(torch.ones(1, 6).double(), torch.zeros(1, 6).double(), log_std[None], used)[1]
    )


def test_log_probability_by_hand() -> None:
    # left.reach.x, left.reach.y, left.raise.distance, right.reach.x, right.reach.y, right.raise.distance
    assert PAIRS.argument_count == 6
    arguments = tensor([0.5, -1.0, 9.0, 9.0, 9.0, 0.2], dtype=torch.float64)
    mean = tensor([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    std = tensor([0.5, 1.0, 1.0, 1.0, 1.0, 0.1], dtype=torch.float64)
    # (reach, raise) uses the first two and the last; log sqrt(2 pi) = 0.9189385:
    #   x: z = 1,  -0.5 - log 0.5 - 0.9189385 = -0.7257914
    #   y: z = -1, -0.5 - 0       - 0.9189385 = -1.4189385
    #   d: z = 2,  -2.0 - log 0.1 - 0.9189385 = -0.6163534
    result = log_probability(("reach", "raise"), arguments, mean, std.log())
    assert result == pytest.approx(-0.7257914 - 1.4189385 - 0.6163534, abs=1e-6)


def test_entropy_by_hand() -> None:
    std = tensor([0.5, 1.0, 1.0, 1.0, 1.0, 0.1], dtype=torch.float64)
    # 1/2 log(2 pi e) = 1.4189385 for each of three, plus log 0.5 = -0.6931472, 0, log 0.1 = -2.3025851
    assert entropy(("reach", "raise"), std.log()) == pytest.approx(3 * 1.4189385 - 2.9957323, abs=1e-6)


def test_skills_without_arguments_contribute_nothing() -> None:
    arguments = torch.full((6,), 50.0, dtype=torch.float64)
    zeros = torch.zeros(6, dtype=torch.float64)
    assert log_probability(("no_op", "no_op"), arguments, zeros, zeros - 4) == 0.0
    assert entropy(("no_op", "no_op"), zeros - 4) == 0.0
    only_right = log_probability(("no_op", "raise"), zeros, zeros, zeros)
    assert only_right == pytest.approx(-0.9189385, abs=1e-6)


def test_unused_arguments_have_no_gradient_and_no_nan() -> None:
    mean = torch.zeros(1, 6, requires_grad=True)
    log_std = torch.full((1, 6), -4.0, requires_grad=True)
    used = torch.from_numpy(PAIRS.used[[PAIRS.index("no_op", "no_op")]]).float()
    sum(argument_terms(torch.ones(1, 6), mean, log_std, used)).sum().backward()
    assert not mean.grad.any()
    assert not log_std.grad.any()


@settings(max_examples=30, deadline=None)
@given(mean=number, log_std=st.floats(-2.0, -0.5), pair=st.sampled_from(PAIRS.pairs))
def test_density_integrates_to_one_and_entropy_is_its_integral(
    mean: float, log_std: float, pair: tuple[str, str]
) -> None:
    """One argument's density is integrated; the others of the pair add constants, which are known."""
    index = PAIRS.index(*pair)
    columns = np.flatnonzero(PAIRS.used[index])
    if len(columns) == 0:
        return
    grid = torch.linspace(
        mean - 12 * math.exp(log_std), mean + 12 * math.exp(log_std), 20001, dtype=torch.float64
    )
    arguments = torch.full((len(grid), 6), mean, dtype=torch.float64)
    arguments[:, columns[0]] = grid
    used = torch.from_numpy(PAIRS.used[[index]]).double().expand(len(grid), -1)
    means, log_stds = torch.full_like(arguments, mean), torch.full_like(arguments, log_std)
    others = (len(columns) - 1) * (-log_std - 0.5 * math.log(2 * math.pi))
    log_density, entropies = argument_terms(arguments, means, log_stds, used)
    log_density = log_density - others
    assert float(torch.trapezoid(log_density.exp(), grid)) == pytest.approx(1.0, abs=1e-6)
    integral = float(torch.trapezoid(-log_density.exp() * log_density, grid))
    assert float(entropies[0]) == pytest.approx(len(columns) * integral, abs=1e-5)


@given(logits=st.lists(st.floats(-5, 5), min_size=2, max_size=9), shift=st.floats(-100, 100))
def test_pair_probabilities_by_enumeration(logits: list[float], shift: float) -> None:
    rows = tensor([logits], dtype=torch.float64)
    everyone = torch.arange(len(logits))
    logs = pair_log_probability(rows.expand(len(logits), -1), everyone)
    assert float(logs.exp().sum()) == pytest.approx(1.0)
    assert float(pair_entropy(rows)) == pytest.approx(float(-(logs.exp() * logs).sum()), abs=1e-9)
    assert torch.allclose(
        pair_log_probability((rows + shift).expand(len(logits), -1), everyone), logs, atol=1e-9
    )


def test_clipped_policy_loss_by_hand() -> None:
    ratio = tensor([1.5, 0.5, 1.1, 0.5])
    advantages = tensor([2.0, -1.0, 1.0, 3.0])
    # min(r A, clip(r, 0.8, 1.2) A): min(3, 2.4), min(-0.5, -0.8), min(1.1, 1.1), min(1.5, 2.4)
    #   = 2.4, -0.8, 1.1, 1.5; mean = 4.2 / 4 = 1.05
    loss, _ = clipped_policy_loss(ratio.log(), advantages, 0.2)
    assert float(loss) == pytest.approx(-1.05, abs=1e-6)


def test_clipping_stops_the_gradient_only_where_the_step_is_already_taken() -> None:
    log_ratio = tensor([1.5, 0.5, 1.5, 0.5]).log()
    _, gradient = clipped_policy_loss(log_ratio, tensor([1.0, -1.0, -1.0, 1.0]), 0.2)
    # -r A / B: 1.5 / 4, -0.5 / 4
    assert gradient.tolist() == pytest.approx([0.0, 0.0, 0.375, -0.125], abs=1e-6)


def test_clipped_value_loss_by_hand() -> None:
    values, old, returns = tensor([1.0, 0.1, 0.5]), tensor([0.0, 0.0, 0.5]), tensor([1.0, 1.0, 0.0])
    # clipped values: 0.2, 0.1, 0.5; squared errors max(0, 0.64), max(0.81, 0.81), max(0.25, 0.25)
    # half the mean: (0.64 + 0.81 + 0.25) / 3 / 2 = 0.2833333
    loss, gradient = clipped_value_loss(values, old, returns, 0.2)
    assert float(loss) == pytest.approx(0.2833333, abs=1e-6)
    # the first is held back: 0; the others (V - R) / 3
    assert gradient.tolist() == pytest.approx([0.0, -0.3, 0.1666667], abs=1e-6)
    # without clipping: (0 + 0.81 + 0.25) / 3 / 2 = 0.1766667
    loss, gradient = clipped_value_loss(values, old, returns, None)
    assert float(loss) == pytest.approx(0.1766667, abs=1e-6)
    assert gradient.tolist() == pytest.approx([0.0, -0.3, 0.1666667], abs=1e-6)


def test_normalise_by_hand() -> None:
    # mean 0.5; sample variance (0.25 * 4) / 3 = 1/3, std 0.5773503
    wide = normalise(tensor([0.0, 1.0, 0.0, 1.0]), 0.1)
    assert wide.tolist() == pytest.approx([-0.8660254, 0.8660254, -0.8660254, 0.8660254], abs=1e-6)
    # std 0.01 is below the floor 0.1
    narrow = normalise(tensor([0.00, 0.02]), 0.1)
    assert narrow.tolist() == pytest.approx([-0.1, 0.1], abs=1e-6)
    assert normalise(tensor([0.3, 0.3]), 0.0).tolist() == pytest.approx([0.0, 0.0])
    assert normalise(tensor([0.3]), 0.1).tolist() == [0.0]


def test_written_gradients_are_the_numerical_ones() -> None:
    rng = torch.Generator().manual_seed(0)
    arguments, mean, log_std = (torch.randn(4, 6, generator=rng, dtype=torch.float64) for _ in range(3))
    used = torch.from_numpy(PAIRS.used[[0, 3, 4, 8]]).double()
    inputs = (arguments, mean.requires_grad_(), log_std.requires_grad_(), used)
    assert torch.autograd.gradcheck(argument_terms, inputs)
