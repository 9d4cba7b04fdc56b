"""Log-probabilities, entropies and losses, as pure functions of B samples."""

import math

import torch
from torch import Tensor

_LOG_2PI = math.log(2.0 * math.pi)


def argument_log_probability(arguments: Tensor, mean: Tensor, log_std: Tensor, used: Tensor) -> Tensor:
    """Return the log-density [B] of raw samples under independent Gaussians, over the used ones only.

        log p = -1/2 sum_i used_i (((a_i - mean_i) / std_i)^2 + 2 log std_i + log 2 pi)

    A pair whose skills take no arguments has log-density 0.

    Args:
        arguments: [B, A] raw normalised samples.
        mean: [B, A].
        log_std: [B, A].
        used: [B, A] 1 for the arguments of the chosen pair's skills, of both arms, else 0.

    """
    z = (arguments - mean) * torch.exp(-log_std)
    return -0.5 * (used * (z * z + 2.0 * log_std + _LOG_2PI)).sum(dim=1)


def argument_entropy(log_std: Tensor, used: Tensor) -> Tensor:
    """Return the differential entropy [B, nat] of the used arguments.

    H = sum_i used_i (log std_i + log(2 pi e) / 2)
    """
    return (used * (log_std + 0.5 * (_LOG_2PI + 1.0))).sum(dim=1)


def pair_log_probability(pair_logits: Tensor, pairs: Tensor) -> Tensor:
    """Return the log-probability [B] of pairs [B] under logits [B, |X|]."""
    return torch.log_softmax(pair_logits, dim=1).gather(1, pairs[:, None])[:, 0]


def pair_entropy(pair_logits: Tensor) -> Tensor:
    """Return the entropy [B, nat] of the categorical distributions with logits [B, |X|]."""
    logs = torch.log_softmax(pair_logits, dim=1)
    return -(logs.exp() * logs).sum(dim=1)


def normalise(advantages: Tensor, std_floor: float) -> Tensor:
    """Return advantages [B] less their mean, over the larger of their standard deviation and `std_floor`."""
    centred = advantages - advantages.mean()
    if len(advantages) < 2:
        return centred
    return centred / advantages.std().clamp(min=max(std_floor, 1e-8))


def clipped_policy_loss(log_ratio: Tensor, advantages: Tensor, clip: float) -> Tensor:
    """Return PPO's clipped surrogate loss (Schulman et al., 2017, equation 7), from log pi/pi_old [B].

    L = -mean(min(r A, clip(r, 1 - c, 1 + c) A)),   r = exp(log_ratio)
    """
    ratio = torch.exp(log_ratio)
    return -torch.min(ratio * advantages, ratio.clamp(1.0 - clip, 1.0 + clip) * advantages).mean()


def clipped_value_loss(values: Tensor, old_values: Tensor, returns: Tensor, clip: float | None) -> Tensor:
    """Return half the squared error of values [B], as in Stable Baselines; None: no clipping.

    L = 1/2 mean(max((V - R)^2, (V_old + clip(V - V_old, -c, c) - R)^2))
    """
    error = (values - returns).square()
    if clip is not None:
        clipped = old_values + (values - old_values).clamp(-clip, clip)
        error = torch.max(error, (clipped - returns).square())
    return 0.5 * error.mean()
