"""A round's trajectories as arrays and tensors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from taskschema.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from taskschema.config import ObservationKind
from taskschema.policies.spatial_layout import SpatialLayout
from taskschema.tasks.task import Task
from taskschema.trajectory import Trajectory


@dataclass(frozen=True)
class Batch:
    """The B steps of N episodes, in the order of slot, episode and step."""

    inputs: AnyArray
    """[B, D] scaled observations, or frames [B, 256, 256, 3]."""
    pairs: IntArray
    """[B] skill pair."""
    arguments: Float32Array
    """[B, A] raw samples; [B, R] on images."""
    used: BoolArray
    """[B, A] which arguments the pair uses; [B, R] on images."""
    rewards: FloatArray
    """[N, T] 1 at a successful episode's last step, else 0."""
    lengths: IntArray
    """[N] steps of each episode."""

    @property
    def inside(self) -> BoolArray:
        """[N, T] which steps were executed: `array[inside]` is [B]."""
        mask: BoolArray = np.arange(self.rewards.shape[1]) < self.lengths[:, None]
        return mask

    def padded(self, values: AnyArray) -> FloatArray:
        """Spread values [B] over [N, T], 0 where nothing was executed."""
        result = np.zeros(self.rewards.shape)
        result[self.inside] = values
        return result


@dataclass(frozen=True)
class Samples:
    """Steps as tensors, for one network's precision and device."""

    inputs: torch.Tensor
    """[B, D], or what `SpatialNetwork.inputs` keeps of frames"""
    pairs: torch.Tensor
    """[B]"""
    arguments: torch.Tensor
    """[B, A]"""
    used: torch.Tensor
    """[B, A], 0 or 1."""
    old_log_probabilities: torch.Tensor
    """[B] under the policy that acted."""
    old_values: torch.Tensor
    """[B]"""
    advantages: torch.Tensor
    """[B]"""
    returns: torch.Tensor
    """[B] the values' targets."""


def in_order(trajectories: Sequence[Trajectory]) -> list[Trajectory]:
    """Return the trajectories by slot and episode, so that the order of their arrival does not matter."""
    return sorted(trajectories, key=lambda item: (item.slot, item.episode))


def collate(trajectories: Sequence[Trajectory], task: Task, observation: ObservationKind = "state") -> Batch:
    """Put trajectories, already in order, into arrays."""
    lengths = np.array([len(item) for item in trajectories], dtype=np.int64)
    success = np.array([item.success for item in trajectories])
    rewards = np.zeros((len(trajectories), task.horizon))
    rewards[success, lengths[success] - 1] = 1.0
    pairs = np.concatenate([item.pairs for item in trajectories])
    observations = np.concatenate([item.observations for item in trajectories])
    on_images = observation == "image"
    used = SpatialLayout(task.image_pairs).used if on_images else task.pairs.used
    return Batch(
        inputs=observations if on_images else task.observation.to_network(observations),
        pairs=pairs,
        arguments=np.concatenate([item.arguments for item in trajectories]),
        used=used[pairs],
        rewards=rewards,
        lengths=lengths,
    )
