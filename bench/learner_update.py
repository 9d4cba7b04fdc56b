"""The learner's update beside `PPO.train()` of Stable-Baselines3, on the same network and batch."""

import time
from collections.abc import Callable
from statistics import median
from typing import NamedTuple

import numpy as np
import torch

from bench.entry import Entry
from bench.stable_baselines_twin import make_twin, train_with, weights_of
from taskschema.arrays import Float32Array
from taskschema.config import NetworkConfig, PPOConfig
from taskschema_learner.networks.argument_network import ArgumentNetwork
from taskschema_learner.networks.initial_weights import initial_weights
from taskschema_learner.update.batch import Batch
from taskschema_learner.update.optimiser import Optimiser

EPISODES, STEPS = 200, 3
OBSERVATIONS, ARGUMENTS = 80, 8
"""About those of lateral lifting."""

CONFIG = PPOConfig(value_clip=None, advantage_std_floor=0.0)
"""What Stable-Baselines3 does: values are not clipped, advantages always divided by their deviation."""
NETWORK = NetworkConfig(initial_log_std=-2.0)
"""Standard deviations far from their bounds, which Stable-Baselines3 does not have."""
PAIRS = 20
"""Updates of each, taking turns, whose median ratio is one repeat's."""


def measure(repeats: int) -> list[Entry]:
    """Return the ratio of both times, interleaved, in processor time of this thread."""
    torch.set_num_threads(1)
    batch = make_batch()
    start = initial_weights(np.random.default_rng(0), OBSERVATIONS, NETWORK, ARGUMENTS)
    one_pair(start, batch, seed=0)  # the first calls also allocate
    ratios = []
    for repeat in range(repeats):
        seconds = [one_pair(start, batch, seed=repeat * PAIRS + pair).seconds for pair in range(PAIRS)]
        ratios.append(median(ours / theirs for ours, theirs in seconds))
        ours, theirs = (1e3 * median(side) for side in zip(*seconds, strict=True))
        print(f"  update: {ours:.1f} ms, Stable-Baselines3: {theirs:.1f} ms", flush=True)
    return [
        Entry.of(6, "learner update / PPO.train() of Stable-Baselines3 2.9", ratios, "x", 0.5, "lower"),
    ]


class Pair(NamedTuple):
    """One update of each side, ours first."""

    seconds: tuple[float, float]
    weights: tuple[dict[str, Float32Array], dict[str, Float32Array]]


def one_pair(start: dict[str, Float32Array], batch: Batch, seed: int) -> Pair:
    """Time an update of each from the same start, with the same permutations of the minibatches."""
    network = ArgumentNetwork(OBSERVATIONS, NETWORK.hidden, ARGUMENTS)
    network.load(start)
    optimiser, twin = Optimiser(network, CONFIG), make_twin(start, batch, CONFIG)
    ours, theirs = (np.random.default_rng(seed) for _ in range(2))
    seconds = (
        _seconds(lambda: optimiser.update(batch, ours)),
        _seconds(lambda: train_with(twin, theirs.permutation)),
    )
    return Pair(seconds, (network.weights(), weights_of(twin)))


def make_batch() -> Batch:
    """Return a round whose episodes all have three steps and use every argument."""
    rng = np.random.default_rng(0)
    count = EPISODES * STEPS
    rewards = np.zeros((EPISODES, STEPS))
    rewards[:, -1] = rng.random(EPISODES) < 0.3
    return Batch(
        inputs=rng.normal(size=(count, OBSERVATIONS)).astype(np.float32),
        pairs=np.zeros(count, dtype=np.int64),
        arguments=rng.normal(0, 0.5, size=(count, ARGUMENTS)).astype(np.float32),
        used=np.ones((count, ARGUMENTS), dtype=bool),
        rewards=rewards,
        lengths=np.full(EPISODES, STEPS),
    )


def _seconds(work: Callable[[], object]) -> float:
    started = time.thread_time()
    work()
    return time.thread_time() - started


if __name__ == "__main__":
    for entry in measure(5):
        print(entry)
