"""Bounds of a network's output that its gradient can come back from."""

from typing import Any

import torch
from torch import Tensor


def bounded_gradient(gradient: Tensor, excess: Tensor) -> Tensor:
    """Return the gradient of clamped values, 0 only where descending it would push further out of the bounds.

    The entropy bonus then cannot drive a bounded value away behind its bound, from where nothing would
    bring it back.

    Args:
        gradient: by the clamped values.
        excess: the values less the clamped ones.

    """
    return gradient * (gradient * excess >= 0)


def bounded(values: Tensor, low: float, high: float) -> Tensor:
    """Return values limited to [low, high], with `bounded_gradient`."""
    limited: Tensor = _Bounded.apply(values, low, high)  # type: ignore[no-untyped-call]
    return limited


class _Bounded(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, values: Tensor, low: float, high: float) -> Tensor:  # noqa: ANN401
        """Return values limited to [low, high]."""
        limited = values.clamp(low, high)
        ctx.save_for_backward(values - limited)
        return limited

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:  # noqa: ANN401
        """Return the gradient, 0 where descending it would leave the bounds."""
        return bounded_gradient(gradients[0], *ctx.saved_tensors), None, None
