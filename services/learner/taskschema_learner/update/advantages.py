"""Advantages and returns of whole episodes."""

import numpy as np

from taskschema.arrays import AnyArray, FloatArray, IntArray


def generalised_advantages(
    rewards: AnyArray, values: AnyArray, lengths: IntArray, gamma: float, gae_lambda: float
) -> FloatArray:
    """Return generalised advantage estimates [N, T] of N whole episodes (Schulman et al., 2016).

        delta_t = r_t + gamma V(s_{t+1}) - V(s_t),   A_t = delta_t + gamma lambda A_{t+1}

    Episodes end for good, so V and A are 0 behind an episode's last step: nothing is bootstrapped there.

    Args:
        rewards: [N, T], 0 behind an episode's end.
        values: [N, T] V(s_t); what stands behind an episode's end is not read.
        lengths: [N] steps of each episode, 1 to T.
        gamma: discount per step.
        gae_lambda: lambda.

    """
    inside = np.arange(rewards.shape[1]) < lengths[:, None]
    values = np.where(inside, values, 0.0)
    advantages = np.zeros(rewards.shape)
    next_value = np.zeros(len(rewards))
    next_advantage = np.zeros(len(rewards))
    for step in reversed(range(rewards.shape[1])):
        delta = rewards[:, step] + gamma * next_value - values[:, step]
        next_advantage = np.where(inside[:, step], delta + gamma * gae_lambda * next_advantage, 0.0)
        next_value = values[:, step]
        advantages[:, step] = next_advantage
    return advantages
