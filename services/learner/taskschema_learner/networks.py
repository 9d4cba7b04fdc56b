"""The argument network in torch: the trainable twin of `taskschema.policies.network`."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor

from taskschema.arrays import AnyArray, Float32Array
from taskschema.policies.network import LOG_STD_RANGE
from taskschema_learner.losses import argument_terms
from taskschema_learner.perceptron import Perceptron, layer_views, parameter_count


@dataclass(frozen=True)
class Evaluation:
    """What the network says about B observations, as tensors that carry gradients."""

    mean: Tensor
    """[B, A] mean of each normalised argument."""
    log_std: Tensor
    """[B, A] log standard deviation."""
    value: Tensor
    """[B] expected return."""
    pair_logits: Tensor | None
    """[B, |X|] logits over skill pairs, of the `state` policy only."""

    def argument_terms(self, arguments: Tensor, used: Tensor) -> tuple[Tensor, Tensor]:
        """Return log-density [B] and entropy [B, nat] of raw arguments [B, A]; see `losses`."""
        return argument_terms(arguments, self.mean, self.log_std, used)


class ArgumentNetwork:
    """An MLP of 4 layers of 64, ReLU, with heads for the actor and the critic (paper, section IV-A).

    Mean *and* variance of every argument depend on the state (section III). All parameters are views of one
    flat vector, and the heads are the rows of one matrix.
    """

    def __init__(
        self, inputs: int, hidden: tuple[int, ...], arguments: int, pairs: int = 0, device: str = "cpu"
    ) -> None:
        """Build the network with all weights zero.

        Args:
            inputs: D, the length of an observation.
            hidden: units of the trunk's layers.
            arguments: A, the length of the argument vector.
            pairs: |X| for the `state` policy, 0 for policies that do not choose the pair.
            device: `cpu` or `cuda`.

        """
        self._heads = {"mean": arguments, "log_std": arguments, "value": 1}
        if pairs:
            self._heads["pair"] = pairs
        self._shapes = list(pairwise([inputs, *hidden, sum(self._heads.values())]))
        self.flat = torch.zeros(parameter_count(self._shapes), device=device, requires_grad=True)
        """[P] all parameters."""

    def use_float64(self) -> None:
        """Compute in double precision, for comparisons with other implementations."""
        self.flat = self.flat.detach().double().requires_grad_()

    def __call__(self, inputs: Tensor) -> Evaluation:
        """Run the network on scaled observations [B, D]."""
        outputs = Perceptron.apply(self.flat, inputs, self._shapes)  # type: ignore[no-untyped-call]
        heads = outputs.split(list(self._heads.values()), dim=1)
        return Evaluation(
            mean=heads[0],
            log_std=bounded(heads[1], *LOG_STD_RANGE),
            value=heads[2][:, 0],
            pair_logits=heads[3] if len(heads) > 3 else None,
        )

    def inputs(self, observations: AnyArray) -> Tensor:
        """Return scaled observations [B, D] as the network takes them."""
        return torch.from_numpy(observations).to(self.flat)

    def _named(self) -> dict[str, Tensor]:
        """Return views of the parameters under the names that they travel by."""
        *trunk, (weights, biases) = layer_views(self.flat.detach(), self._shapes)
        views = {}
        for index, (weight, bias) in enumerate(trunk):
            views[f"trunk.{index}.weight"] = weight
            views[f"trunk.{index}.bias"] = bias
        sizes = list(self._heads.values())
        parts = zip(self._heads, torch.split(weights, sizes), torch.split(biases, sizes), strict=True)
        for name, weight, bias in parts:
            views[f"{name}.weight"] = weight
            views[f"{name}.bias"] = bias
        return views

    def weights(self) -> dict[str, Float32Array]:
        """Return copies of the weights by name, as `taskschema.policies.network.forward` takes them."""
        return {name: array.astype(np.float32) for name, array in self.exact_weights().items()}

    def exact_weights(self) -> dict[str, AnyArray]:
        """Return copies of the weights by name, in the precision of the computation."""
        return {name: view.cpu().numpy().copy() for name, view in self._named().items()}

    def load(self, weights: dict[str, Float32Array]) -> None:
        """Set all weights by name.

        Raises:
            ValueError: if names or shapes are not this network's.

        """
        views = self._named()
        shapes = {name: tuple(view.shape) for name, view in views.items()}
        if shapes != {name: array.shape for name, array in weights.items()}:
            raise ValueError(f"The weights are not of this network, which has {shapes}.")
        for name, view in views.items():
            view.copy_(torch.from_numpy(np.array(weights[name])))


def bounded(values: Tensor, low: float, high: float) -> Tensor:
    """Return values limited to [low, high]; see `_Bounded`."""
    limited: Tensor = _Bounded.apply(values, low, high)  # type: ignore[no-untyped-call]
    return limited


class _Bounded(torch.autograd.Function):
    """Clamping whose gradient vanishes only where it pushes further out.

    The entropy bonus then cannot drive a bounded value away behind its bound, from where nothing would
    bring it back.
    """

    @staticmethod
    def forward(ctx: Any, values: Tensor, low: float, high: float) -> Tensor:  # noqa: ANN401
        """Return values limited to [low, high]."""
        bounded = values.clamp(low, high)
        ctx.save_for_backward(values - bounded)
        return bounded

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:  # noqa: ANN401
        """Return the gradient, 0 where descending it would leave the bounds."""
        (excess,) = ctx.saved_tensors
        return gradients[0] * (gradients[0] * excess >= 0), None, None
