"""Rollouts: the episodes of some slots, run as one batch on one policy version."""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

import numpy as np
from threadpoolctl import threadpool_limits

from taskschema.arrays import AnyArray, Float32Array
from taskschema.policies import ActingPolicy
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.task import BatchEnvironment
from taskschema.trajectory import Trajectory


@dataclass
class _Episode:
    """One episode while it runs."""

    key: EpisodeKey
    observations: list[AnyArray] = field(default_factory=list)
    pairs: list[int] = field(default_factory=list)
    arguments: list[Float32Array] = field(default_factory=list)
    success: bool = False
    diverged: bool = False
    physics_steps: int = 0
    refused: int = 0

    def trajectory(self) -> Trajectory:
        return Trajectory(
            round=self.key.round,
            slot=self.key.slot,
            episode=self.key.episode,
            observations=np.stack(self.observations),
            pairs=np.array(self.pairs, dtype=np.int64),
            arguments=np.stack(self.arguments),
            success=self.success,
            diverged=self.diverged,
            attempt=self.key.attempt,
            physics_steps=self.physics_steps,
            refused=self.refused,
        )


def collect_slots(
    environment: BatchEnvironment,
    policy: ActingPolicy,
    *,
    seed: int,
    round_index: int,
    slots: Sequence[int],
    episodes_per_slot: int,
    horizon: int,
) -> list[list[Trajectory]]:
    """Run all episodes of the given slots as one batch and return one list of trajectories per slot.

    An episode's result depends on its key alone, never on which others share the batch: finished ones
    leave it, and all randomness is keyed. The policy acts on the very float32 values that are streamed,
    so that the learner sees exactly what was acted on. An episode ends at its first success, at `horizon`
    steps, or, as a failure, when the simulation breaks down.
    """
    keys = [
        EpisodeKey(seed, round_index, slot, episode) for slot in slots for episode in range(episodes_per_slot)
    ]
    episodes = [_Episode(key) for key in keys]
    observations = _as_streamed(environment.reset([generator(key, Purpose.RESET) for key in keys]))
    live = np.arange(len(keys))
    for step in range(horizon):
        streams = [generator(keys[index], Purpose.ACTION, step) for index in live]
        with _one_thread(observations):
            actions = policy.act(observations, step, streams)
        result = environment.step(live, actions.pairs, actions.arguments)
        for row, index in enumerate(live):
            episode = episodes[index]
            episode.observations.append(observations[row])
            episode.pairs.append(int(actions.pairs[row]))
            episode.arguments.append(actions.raw[row])
            episode.diverged = bool(result.diverged[row])
            episode.success = bool(result.success[row]) and not episode.diverged
            episode.physics_steps += int(result.physics_steps[row])
            episode.refused += int(result.refused is not None and result.refused[row])
        unfinished = ~(result.success | result.diverged)
        live = live[unfinished]
        if len(live) == 0:
            break
        observations = _as_streamed(result.observations[unfinished])
    trajectories = [episode.trajectory() for episode in episodes]
    return [
        trajectories[start : start + episodes_per_slot] for start in range(0, len(keys), episodes_per_slot)
    ]


def _one_thread(observations: AnyArray) -> AbstractContextManager[object]:
    """Let BLAS use one thread for frames: how it shares a convolution's product changes bits."""
    return threadpool_limits(limits=1) if observations.dtype == np.uint8 else nullcontext()


def _as_streamed(observations: AnyArray) -> AnyArray:
    """Return observations in the type that they travel in: frames as they are, states as float32."""
    return observations if observations.dtype == np.uint8 else observations.astype(np.float32)
