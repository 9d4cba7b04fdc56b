"""One PPO update of the argument part equals Stable-Baselines3's, number for number."""

import sys
from pathlib import Path

import numpy as np
import pytest
import torch

sys.path.insert(0, str(Path(__file__).parents[2]))  # bench is no installed package

from bench.stable_baselines_twin import make_twin, train_with, weights_of

from taskschema.config import NetworkConfig, PPOConfig
from taskschema_learner.networks.argument_network import ArgumentNetwork
from taskschema_learner.networks.initial_weights import initial_weights
from taskschema_learner.update.batch import Batch
from taskschema_learner.update.optimiser import Optimiser


def random_batch(seed: int, episodes: int = 80, inputs: int = 9, arguments: int = 6) -> Batch:
    """Return whole episodes of 1 to 3 steps, every argument used, as many steps as minibatches divide."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 4, size=episodes)
    lengths[-4:] = 3
    while lengths.sum() % 4:
        lengths[int(np.flatnonzero(lengths > 1)[0])] -= 1
    count = int(lengths.sum())
    rewards = np.zeros((episodes, 3))
    rewards[np.arange(episodes), lengths - 1] = rng.random(episodes) < 0.3
    return Batch(
        inputs=rng.normal(size=(count, inputs)).astype(np.float32),
        pairs=np.zeros(count, dtype=np.int64),
        arguments=rng.normal(0, 0.5, size=(count, arguments)).astype(np.float32),
        used=np.ones((count, arguments), dtype=bool),
        rewards=rewards,
        lengths=lengths,
    )


@pytest.mark.parametrize("seed", [0, 1])
def test_one_update_equals_stable_baselines(seed: int) -> None:
    config = PPOConfig(value_clip=None, advantage_std_floor=0.0)
    rng = np.random.default_rng(seed)
    start = initial_weights(rng, 9, NetworkConfig(initial_log_std=-2.0), 6)  # far from its bounds
    start = {
        name: array + rng.normal(0, 0.05, array.shape).astype(np.float32) for name, array in start.items()
    }
    batch = random_batch(seed)

    network = ArgumentNetwork(9, (64, 64, 64, 64), 6)
    network.use_float64()
    network.load(start)
    Optimiser(network, config).update(batch, np.random.default_rng(7))

    twin = make_twin(start, batch, config, dtype=torch.float64)
    train_with(twin, np.random.default_rng(7).permutation)

    theirs = weights_of(twin)
    ours = network.exact_weights()
    assert ours.keys() == theirs.keys()
    for name, array in ours.items():
        np.testing.assert_allclose(array, theirs[name], atol=1e-8, err_msg=name)
    moved = max(float(np.abs(array - start[name]).max()) for name, array in ours.items())
    assert moved > 5e-3  # sixteen steps of Adam at 0.001 moved both alike
