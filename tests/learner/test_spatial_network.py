"""The spatial network: the same in numpy and torch, and its mixed action's density is exact."""

import math
from functools import cache

import numpy as np
import pytest
import torch
from spatial_setup import TOY, image_config, some_policy, some_weights, streams, toy_frames
from threadpoolctl import threadpool_info, threadpool_limits

from taskschema.policies import policy_of
from taskschema.policies.spatial_layout import CELLS, SpatialLayout
from taskschema.policies.spatial_network import SpatialNetwork as NumpyNetwork
from taskschema.policies.spatial_trunk import TRUNKS
from taskschema.randomness import Purpose, round_generator
from taskschema.trajectory import Trajectory
from taskschema_learner.learner import Learner
from taskschema_learner.networks.initial_weights import initial_spatial_weights
from taskschema_learner.networks.spatial_network import (
    FRAMES_AT_ONCE,
    SPREAD_ENTROPY,
    SpatialEvaluation,
    SpatialNetwork,
)
from taskschema_learner.update.batch import collate
from taskschema_learner.update.optimiser import Optimiser
from taskschema_learner.update.parallel_parts import ParallelParts

LAYOUT = SpatialLayout(TOY.image_pairs)


def torch_network(trunk: str, weights: dict[str, np.ndarray] | None = None) -> SpatialNetwork:
    network = SpatialNetwork(TOY, image_config(trunk).image)
    network.load(weights or some_weights(trunk))
    return network


@cache
def drawn_once(trunk: str) -> dict[str, np.ndarray]:
    """VGG16's weights take longer to draw than a frame to see; for tests without `cheap_vgg`."""
    return some_weights(trunk)


@pytest.mark.parametrize(("trunk", "count"), [("small", 3), ("vgg16", 1)])
def test_numpy_and_torch_compute_the_same(trunk, count):
    frames, weights = toy_frames(count), drawn_once(trunk)
    expected = NumpyNetwork(weights, trunk, LAYOUT, TOY.table, TOY.table_view).forward(frames)
    network = torch_network(trunk, weights)
    with torch.no_grad():
        found = network(network.inputs(frames))
    for name in ("response", "mean", "log_std", "value"):
        reference = getattr(expected, name)
        assert getattr(found, name).shape == reference.shape
        assert getattr(found, name).numpy() == pytest.approx(reference, rel=1e-3, abs=1e-3)
    assert found.response.shape == (count, 2, 64)
    assert found.response.std() > 0.01


@pytest.mark.parametrize(("trunk", "channels"), [("small", 32), ("vgg16", 512)])
def test_the_maps_have_the_papers_shapes(trunk, channels):
    network = torch_network(trunk, drawn_once(trunk))
    features = network._features(torch.from_numpy(toy_frames(1)), network._named())
    assert features.shape == (1, channels, 16, 16)
    squeezed, maps = network._maps_of(network.flat, network.inputs(toy_frames(1)))
    assert squeezed.shape == (1, 16, 8, 8)
    assert maps.shape == (1, 2 + 4 + 2 * 1, 8, 8)


def test_first_weights_are_drawn_on_one_thread(monkeypatch):
    """On more a VGG16 takes minutes where the cores have other work."""
    threads, factorise = set(), np.linalg.qr

    def watched(matrix):
        threads.update(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        return factorise(matrix)

    monkeypatch.setattr(np.linalg, "qr", watched)
    with threadpool_limits(limits=2):
        initial_spatial_weights(np.random.default_rng(0), image_config(), TOY)
    assert threads == {1}


def evaluation(batch: int, seed: int = 0) -> SpatialEvaluation:
    generator = torch.Generator().manual_seed(seed)
    return SpatialEvaluation(
        response=torch.randn((1, 2, CELLS), generator=generator).double().expand(batch, -1, -1),
        mean=0.3 * torch.randn((1, 2, 3, CELLS), generator=generator).double().expand(batch, -1, -1, -1),
        log_std=torch.tensor([[-1.0, -1.5, -2.0], [-1.2, -1.1, -1.7]], dtype=torch.float64),
        value=torch.zeros(batch).double(),
    )


def grid_of_arm(arm: int, points: int) -> tuple[torch.Tensor, float]:
    """All cells of one arm times a grid over its offset along x: raw actions [64 * points, 8]."""
    places = torch.linspace(-3.0, 3.0, points, dtype=torch.float64)
    raw = torch.zeros((CELLS * points, LAYOUT.size), dtype=torch.float64)
    start = LAYOUT.columns(arm).start
    raw[:, start] = torch.arange(CELLS).repeat_interleave(points).double()
    raw[:, start + 1] = places.repeat(CELLS)
    return raw, float(places[1] - places[0])


@pytest.mark.parametrize("arm", [0, 1])
def test_density_sums_to_one_and_entropy_is_its_mean_by_enumeration(arm):
    raw, width = grid_of_arm(arm, points=601)
    used = torch.zeros_like(raw)
    used[:, LAYOUT.columns(arm).start : LAYOUT.columns(arm).start + 2] = 1.0  # the cell and one offset
    logs, entropy = evaluation(len(raw)).argument_terms(raw, used)
    density = logs.exp() * width
    assert float(density.sum()) == pytest.approx(1.0, abs=1e-6)
    assert float(-(density * logs).sum()) == pytest.approx(float(entropy[0]), abs=1e-5)


def test_both_arms_and_all_arguments_add_up():
    raw, used = torch.zeros((1, 8)).double(), torch.ones((1, 8)).double()
    raw[0] = torch.tensor([5, 0.1, -0.2, 0.3, 60, 0.0, 0.4, -0.5])
    seen = evaluation(1)
    logs, entropy = seen.argument_terms(raw, used)
    expected, expected_entropy = 0.0, 0.0
    for arm, cell in ((0, 5), (1, 60)):
        probability = torch.softmax(seen.response[0, arm], dim=0)
        expected += math.log(probability[cell])
        expected_entropy -= float((probability * probability.log()).sum())
        for index in range(3):
            std = math.exp(seen.log_std[arm, index])
            z = (float(raw[0, 4 * arm + 1 + index]) - float(seen.mean[0, arm, index, cell])) / std
            expected += -0.5 * z * z - math.log(std) - 0.5 * math.log(2 * math.pi)
            expected_entropy += math.log(std) + 0.5 * math.log(2 * math.pi * math.e)
    assert float(logs) == pytest.approx(expected, abs=1e-9)
    assert float(entropy) == pytest.approx(expected_entropy, abs=1e-9)


def test_what_a_pair_does_not_use_adds_nothing():
    raw = torch.randn((2, 8)).double().abs()
    logs, entropy = evaluation(2).argument_terms(raw, torch.zeros((2, 8)).double())
    assert logs.abs().max() == 0.0
    assert entropy.abs().max() == 0.0


def test_gradients_are_those_of_finite_differences():
    seen = evaluation(1)
    raw = torch.tensor([[5, 0.1, -0.2, 0.3, 60, 0.0, 0.4, -0.5]], dtype=torch.float64)
    used = torch.ones((1, 8), dtype=torch.float64)
    sharp = 4.0 * seen.response
    leaves = [tensor.clone().requires_grad_() for tensor in (sharp, seen.mean, seen.log_std)]

    def terms(*tensors):
        return SpatialEvaluation(*tensors, value=seen.value).argument_terms(raw, used)

    assert float(torch.distributions.Categorical(logits=sharp).entropy().max()) < SPREAD_ENTROPY
    assert torch.autograd.gradcheck(terms, leaves, fast_mode=True)


def test_a_map_that_is_spread_is_not_spread_further():
    seen = evaluation(1)
    raw, used = torch.zeros((1, 8), dtype=torch.float64), torch.ones((1, 8), dtype=torch.float64)
    for scale, moves in ((1.0, False), (4.0, True)):
        response = (scale * seen.response).requires_grad_()
        given = SpatialEvaluation(response, seen.mean, seen.log_std, value=seen.value)
        _, entropy = given.argument_terms(raw, used)
        (gradient,) = torch.autograd.grad(entropy.sum(), response)
        assert bool(gradient.abs().max() > 1e-3) is moves


def trajectories(policy, count):
    """Episodes of one step each, as the policy acted; every other one a success."""
    frames = toy_frames(count)
    actions = policy.act(frames, 0, streams(count))
    return [
        Trajectory(
            round=0,
            slot=index,
            episode=0,
            observations=frames[index : index + 1],
            pairs=actions.pairs[index : index + 1],
            arguments=actions.raw[index : index + 1],
            success=index % 2 == 0,
        )
        for index in range(count)
    ]


@pytest.fixture
def cheap_vgg(monkeypatch):
    """The frozen trunk with a thousandth of its work: what is counted are frames."""
    monkeypatch.setitem(TRUNKS, "vgg16", TRUNKS["small"])


def test_a_frozen_trunk_sees_each_frame_once_to_act_and_once_to_learn(cheap_vgg):
    config, policy = image_config("vgg16"), some_policy("vgg16")
    sample = trajectories(policy, 4)
    network = torch_network("vgg16")
    before = network.weights()
    Optimiser(network, config.ppo).update(
        collate(sample, TOY, "image"), round_generator(0, 0, Purpose.MINIBATCHES)
    )
    assert policy.trunk_passes + network.trunk_passes == 2 * 4  # four epochs reuse the features
    after = network.weights()
    assert np.array_equal(after["trunk.4.weight"], before["trunk.4.weight"])
    assert not np.array_equal(after["squeeze.weight"], before["squeeze.weight"])


def test_an_update_makes_what_succeeded_more_probable_and_is_a_function_of_its_inputs():
    config = image_config()
    results = []
    for _ in range(2):
        learner = Learner(config, TOY)
        snapshot = learner.snapshot()
        sample = trajectories(policy_of(config, TOY, snapshot), 8)
        statistics = learner.update(sample)
        assert np.isfinite(list(vars(statistics).values())).all()
        results.append(learner.snapshot().sha256)
        assert learner.snapshot().sha256 != snapshot.sha256
    assert results[0] == results[1]


@pytest.mark.parametrize("trunk", ["small", "vgg16"])
def test_results_and_gradients_are_the_same_to_the_bit_on_any_number_of_threads(trunk, cheap_vgg):
    frames, found = toy_frames(19), []  # two full parts and a rest
    for threads in (1, 2, 3):
        network = torch_network(trunk)
        network._parts = ParallelParts(network._maps_of, FRAMES_AT_ONCE, threads)
        seen = network(network.inputs(frames))
        loss = seen.response.square().mean() + seen.mean.square().mean() + seen.value.square().mean()
        (gradient,) = torch.autograd.grad(loss, network.flat)
        found.append((float(loss.detach()), gradient.numpy().tobytes()))
    assert found[1:] == found[:1] * 2


def test_the_parts_gradients_add_up_to_the_wholes():
    network, frames = torch_network("small"), torch.from_numpy(toy_frames(11))
    gradients = []
    for squeezed, maps in (network._parts(network.flat, frames), network._maps_of(network.flat, frames)):
        loss = (squeezed.sum(dim=(2, 3)) * maps[:, :1].mean()).square().mean() + maps.square().mean()
        gradients.append(torch.autograd.grad(loss, network.flat)[0])
    assert gradients[0].abs().max() > 0.1
    assert torch.allclose(gradients[0], gradients[1], rtol=1e-3, atol=1e-3 * float(gradients[1].abs().max()))


def test_a_checkpoint_restores_a_learner_on_images():
    config = image_config(seed=3)
    first, second = Learner(config, TOY), Learner(image_config(seed=4), TOY)
    first.update(trajectories(policy_of(config, TOY, first.snapshot()), 4))
    second.restore(first.arrays())
    assert second.snapshot().sha256 == first.snapshot().sha256
