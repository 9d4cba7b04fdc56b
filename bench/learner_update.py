"""The learner's update beside `PPO.train()` of Stable-Baselines3, on the same network and batch."""

import time
from collections.abc import Callable

import numpy as np
import torch

from bench.entry import Entry
from bench.stable_baselines_twin import make_twin, train_with
from taskschema.config import NetworkConfig, PPOConfig
from taskschema_learner.batch import Batch
from taskschema_learner.initial_weights import initial_weights
from taskschema_learner.networks import ArgumentNetwork
from taskschema_learner.optimiser import Optimiser

EPISODES, STEPS = 200, 3
OBSERVATIONS, ARGUMENTS = 80, 8
"""About those of lateral lifting."""


def measure(repeats: int) -> list[Entry]:
    """Return the ratio of both times, interleaved, in processor time of this thread."""
    torch.set_num_threads(1)
    config = PPOConfig(value_clip=None)
    batch = _batch()
    start = initial_weights(np.random.default_rng(0), OBSERVATIONS, NetworkConfig(), ARGUMENTS)
    network = ArgumentNetwork(OBSERVATIONS, NetworkConfig().hidden, ARGUMENTS)
    network.load(start)
    optimiser, twin = Optimiser(network, config), make_twin(start, batch, config)
    rng = np.random.default_rng(1)
    ours, theirs = [], []
    for _ in range(max(repeats, 5) * 4):
        ours.append(_seconds(lambda: optimiser.update(batch, rng)))
        theirs.append(_seconds(lambda: train_with(twin, rng.permutation)))
    print(f"  update: {1e3 * np.median(ours):.1f} ms, Stable-Baselines3: {1e3 * np.median(theirs):.1f} ms")
    ratios = [mine / other for mine, other in zip(ours, theirs, strict=True)]
    return [
        Entry.of(6, "learner update / PPO.train() of Stable-Baselines3 2.9", ratios, "x", 0.5, "lower"),
    ]


def _batch() -> Batch:
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
