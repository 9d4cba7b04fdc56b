"""Log-probabilities, entropies and losses, as pure functions of B samples."""

import math
from typing import Any

import torch
from torch import Tensor

_LOG_2PI = math.log(2.0 * math.pi)


def gaussian_terms(
    arguments: Tensor, mean: Tensor, log_std: Tensor, used: Tensor
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return log-density [B], entropy [B, nat], and z and 1 / std [B, A] for `gaussian_gradients`.

        log p = -1/2 sum_i used_i (z_i^2 + 2 log std_i + log 2 pi),   z_i = used_i (a_i - mean_i) / std_i
        H     =      sum_i used_i (log std_i + log(2 pi e) / 2)

    The arguments are those of `argument_terms`.
    """
    inverse_std = torch.exp(-log_std)
    z = (arguments - mean) * inverse_std * used
    widths = (log_std * used).sum(dim=1)
    count = used.sum(dim=1)
    log_probability = -0.5 * ((z * z).sum(dim=1) + count * _LOG_2PI) - widths
    return log_probability, torch.add(widths, count, alpha=0.5 * (_LOG_2PI + 1.0)), z, inverse_std


def gaussian_gradients(
    by_log_probability: Tensor, by_entropy: Tensor, z: Tensor, inverse_std: Tensor, used: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the gradients by mean and log std [B, A] from those by log-density and entropy [B].

    d log p / d mean = z / std,   d log p / d log std = used (z^2 - 1),   d H / d log std = used
    """
    by_log_probability = by_log_probability[:, None]
    by_scaled_mean = by_log_probability * z
    by_log_std = by_scaled_mean * z + (by_entropy[:, None] - by_log_probability) * used
    return by_scaled_mean * inverse_std, by_log_std


class _ArgumentTerms(torch.autograd.Function):
    """`gaussian_terms` for autograd."""

    @staticmethod
    def forward(  # noqa: D102
        ctx: Any,  # noqa: ANN401
        arguments: Tensor,
        mean: Tensor,
        log_std: Tensor,
        used: Tensor,
    ) -> tuple[Tensor, Tensor]:
        log_probability, entropy, z, inverse_std = gaussian_terms(arguments, mean, log_std, used)
        ctx.save_for_backward(z, inverse_std, used)
        return log_probability, entropy

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[None, Tensor, Tensor, None]:  # noqa: ANN401, D102
        by_mean, by_log_std = gaussian_gradients(gradients[0], gradients[1], *ctx.saved_tensors)
        return None, by_mean, by_log_std, None


def argument_terms(arguments: Tensor, mean: Tensor, log_std: Tensor, used: Tensor) -> tuple[Tensor, Tensor]:
    """Return log-density [B] and differential entropy [B, nat] of the used ones of independent Gaussians.

    See `gaussian_terms`. A pair whose skills take no arguments has log-density 0 and entropy 0.

    Args:
        arguments: [B, A] raw normalised samples.
        mean: [B, A].
        log_std: [B, A].
        used: [B, A] 1 for the arguments of the chosen pair's skills, of both arms, else 0.

    """
    terms: tuple[Tensor, Tensor] = _ArgumentTerms.apply(  # type: ignore[no-untyped-call]
        arguments, mean, log_std, used
    )
    return terms


def pair_log_probability(pair_logits: Tensor, pairs: Tensor) -> Tensor:
    """Return the log-probability [B] of pairs [B] under logits [B, |X|]."""
    return torch.log_softmax(pair_logits, dim=1).gather(1, pairs[:, None])[:, 0]


def pair_entropy(pair_logits: Tensor) -> Tensor:
    """Return the entropy [B, nat] of the categorical distributions with logits [B, |X|]."""
    logs = torch.log_softmax(pair_logits, dim=1)
    return -(logs.exp() * logs).sum(dim=1)


def normalise(advantages: Tensor, std_floor: float) -> Tensor:
    """Return advantages [B] less their mean, over the larger of their standard deviation and `std_floor`."""
    if len(advantages) < 2:
        return torch.zeros_like(advantages)
    std, mean = torch.std_mean(advantages)
    return (advantages - mean) / std.clamp_(min=max(std_floor, 1e-8))


def clipped_policy_loss(log_ratio: Tensor, advantages: Tensor, clip: float) -> tuple[Tensor, Tensor]:
    """Return PPO's clipped surrogate loss (Schulman et al., 2017, equation 7) and its gradient [B].

        L = -mean(min(r A, clip(r, 1 - c, 1 + c) A)),   r = exp(log_ratio)
        dL / d log_ratio = -r A / B,  0 where clipping gives the smaller product

    Args:
        log_ratio: [B] log pi/pi_old.
        advantages: [B]
        clip: c.

    """
    ratio = torch.exp(log_ratio)
    gain = ratio * advantages
    smaller = torch.minimum(gain, ratio.clamp_(1.0 - clip, 1.0 + clip).mul_(advantages))
    gradient = gain * (gain == smaller)
    return smaller.mean().neg_(), gradient.mul_(-1.0 / len(gradient))


def clipped_value_loss(
    values: Tensor, old_values: Tensor, returns: Tensor, clip: float | None
) -> tuple[Tensor, Tensor]:
    """Return half the squared error of values [B], as in Stable Baselines, and its gradient [B].

        L = 1/2 mean(max((V - R)^2, (V_old + clip(V - V_old, -c, c) - R)^2))
        dL / dV = (V - R) / B,  0 where clipping holds V back and gives the larger error

    Args:
        values: [B] V.
        old_values: [B] V_old, before the update.
        returns: [B] R.
        clip: c; None: no clipping.

    """
    error = values - returns
    if clip is None:
        return 0.5 * error.square().mean(), error / len(error)
    change = values - old_values
    clipped = change.clamp(-clip, clip)
    clipped_error = clipped + old_values - returns
    held = (clipped != change) & (clipped_error.abs() > error.abs())
    loss = 0.5 * torch.where(held, clipped_error, error).square().mean()
    return loss, error.masked_fill(held, 0.0) / len(error)
