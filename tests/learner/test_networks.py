"""The torch network is the twin of the numpy one, and starts as documented."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from taskschema.config import NetworkConfig
from taskschema.policies.network import LOG_STD_RANGE, forward
from taskschema_learner.networks.argument_network import ArgumentNetwork
from taskschema_learner.networks.initial_weights import initial_weights


def make(seed: int, inputs: int = 9, arguments: int = 6, pairs: int = 0) -> ArgumentNetwork:
    config = NetworkConfig()
    network = ArgumentNetwork(inputs, config.hidden, arguments, pairs)
    network.load(initial_weights(np.random.default_rng(seed), inputs, config, arguments, pairs))
    return network


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), pairs=st.sampled_from([0, 9]), batch=st.integers(1, 40))
def test_torch_and_numpy_forward_agree(seed: int, pairs: int, batch: int) -> None:
    network = make(seed, pairs=pairs)
    rng = np.random.default_rng(seed)
    weights = {
        name: array + rng.normal(0, 0.1, array.shape).astype(np.float32)
        for name, array in network.weights().items()
    }
    network.load(weights)
    inputs = rng.normal(0, 2, (batch, 9)).astype(np.float32)
    ours = network.heads(network.perceptron.forward(torch.from_numpy(inputs))[-1])
    theirs = forward(weights, inputs)
    for name in ("mean", "log_std", "value") + (("pair_logits",) if pairs else ()):
        np.testing.assert_allclose(getattr(ours, name).numpy(), getattr(theirs, name), atol=1e-5, rtol=1e-5)
    assert (ours.pair_logits is None) == (theirs.pair_logits is None) == (pairs == 0)


def test_weights_travel_by_name() -> None:
    network = make(3, pairs=4)
    weights = network.weights()
    assert weights["trunk.0.weight"].shape == (64, 9)
    assert weights["trunk.3.weight"].shape == (64, 64)
    assert weights["mean.weight"].shape == weights["log_std.weight"].shape == (6, 64)
    assert weights["value.weight"].shape == (1, 64)
    assert weights["pair.weight"].shape == (4, 64)
    assert all(array.dtype == np.float32 for array in weights.values())
    other = ArgumentNetwork(9, (64, 64, 64, 64), 6, 4)
    other.load(weights)
    assert all(np.array_equal(array, weights[name]) for name, array in other.weights().items())


def test_load_refuses_another_networks_weights() -> None:
    with pytest.raises(ValueError, match="not of this network"):
        make(0).load(make(0, pairs=4).weights())


def test_exported_weights_are_copies() -> None:
    network = make(0)
    network.weights()["mean.bias"][:] = 7.0
    assert not network.weights()["mean.bias"].any()


def test_first_weights_are_orthogonal_with_stable_baselines_gains() -> None:
    weights = initial_weights(np.random.default_rng(1), 9, NetworkConfig(initial_log_std=-0.7), 6, 4)
    square = weights["trunk.1.weight"]
    np.testing.assert_allclose(square @ square.T, 2.0 * np.eye(64), atol=1e-5)  # gain sqrt 2
    tall = weights["trunk.0.weight"]
    np.testing.assert_allclose(tall.T @ tall, 2.0 * np.eye(9), atol=1e-5)
    for head in ("mean", "log_std", "pair"):
        wide = weights[f"{head}.weight"]
        np.testing.assert_allclose(wide @ wide.T, 1e-4 * np.eye(len(wide)), atol=1e-8)  # gain 0.01
    assert not weights["value.weight"].any()
    np.testing.assert_allclose(weights["log_std.bias"], -0.7)


def test_the_written_gradient_is_autograds() -> None:
    """Against the same layers, bounds and densities built from torch's own operations."""
    rng = np.random.default_rng(2)
    weights = {
        name: array + rng.normal(0, 0.1, array.shape).astype(np.float32)
        for name, array in make(5, pairs=4).weights().items()
    }
    weights["log_std.bias"] -= 2.0  # far from the bounds, where clamping differs from torch's
    weights["log_std.weight"] *= 0.1
    network = make(5, pairs=4)
    network.load(weights)
    network.use_float64()
    inputs, arguments, by = (torch.from_numpy(rng.normal(size=(7, size))) for size in (9, 6, 7))
    used = torch.from_numpy(rng.random((7, 6)) < 0.5).double()
    terms = network.terms(inputs, arguments, used)
    outputs = (terms.argument_log_probability, terms.argument_entropy, terms.value, terms.pair_logits)
    weightings = (by[:, 0], by[:, 1], by[:, 2], by[:, 3:])
    (ours,) = torch.autograd.grad(outputs, network.flat, weightings)

    leaves = {name: torch.from_numpy(array).double().requires_grad_() for name, array in weights.items()}
    hidden = inputs
    for layer in range(4):
        hidden = torch.relu(hidden @ leaves[f"trunk.{layer}.weight"].T + leaves[f"trunk.{layer}.bias"])
    heads = {
        name: hidden @ leaves[f"{name}.weight"].T + leaves[f"{name}.bias"]
        for name in ("mean", "log_std", "value", "pair")
    }
    normal = torch.distributions.Normal(heads["mean"], heads["log_std"].clamp(*LOG_STD_RANGE).exp())
    theirs = (
        (normal.log_prob(arguments) * used).sum(1),
        (normal.entropy() * used).sum(1),
        heads["value"][:, 0],
        heads["pair"],
    )
    for mine, other in zip(outputs, theirs, strict=True):
        np.testing.assert_allclose(mine.detach().numpy(), other.detach().numpy(), atol=1e-10)
    loss = sum((weighting * other).sum() for weighting, other in zip(weightings, theirs, strict=True))
    gradients = torch.autograd.grad(loss, list(leaves.values()))
    network.flat.data = ours  # reads the gradient by the parameters' names
    for name, gradient in zip(leaves, gradients, strict=True):
        np.testing.assert_allclose(network.exact_weights()[name], gradient.numpy(), atol=1e-10, err_msg=name)


@pytest.mark.parametrize("pairs", [0, 3])
def test_the_written_gradient_is_the_numerical_one(pairs: int) -> None:
    network = ArgumentNetwork(3, (5, 4), 2, pairs)
    network.use_float64()
    rng = torch.Generator().manual_seed(1)
    network.flat.data.normal_(0.0, 0.3, generator=rng)
    network.load({**network.weights(), "log_std.bias": np.full(2, -2.5, dtype=np.float32)})  # in its bounds
    inputs, arguments = (torch.randn(6, size, generator=rng, dtype=torch.float64) for size in (3, 2))
    used = torch.tensor([[1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], dtype=torch.float64).repeat(2, 1)

    def terms(_: torch.Tensor) -> tuple[torch.Tensor, ...]:
        found = network.terms(inputs, arguments, used)
        return tuple(value for value in vars(found).values() if value is not None)

    assert torch.autograd.gradcheck(terms, (network.flat,))


def test_log_std_is_bounded_and_its_gradient_stops_only_outwards() -> None:
    network = make(5)
    low, high = LOG_STD_RANGE
    inputs, nothing, used = torch.ones(2, 9), torch.zeros(2, 6), torch.ones(2, 6)
    for bias, bound, inwards in ((high + 3.0, high, 1.0), (low - 3.0, low, -1.0)):
        network.load({**network.weights(), "log_std.bias": np.full(6, bias, dtype=np.float32)})
        for sign in (inwards, -inwards):  # descending `sign * entropy` moves each log std by -sign
            entropy = network.terms(inputs, nothing, used).argument_entropy
            np.testing.assert_allclose(entropy.detach(), 6 * (bound + 1.4189385), rtol=1e-5)
            (gradient,) = torch.autograd.grad((sign * entropy).sum(), network.flat)
            assert bool(gradient.any()) == (sign == inwards)
