"""The argument network in torch: the trainable twin of `taskschema.policies.network`."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor

from taskschema.arrays import AnyArray, Float32Array
from taskschema.policies.network import LOG_STD_RANGE
from taskschema_learner.networks.bounds import bounded_gradient
from taskschema_learner.networks.perceptron import Perceptron, layer_views, parameter_count
from taskschema_learner.update.action_terms import ActionTerms
from taskschema_learner.update.losses import gaussian_gradients, gaussian_terms


@dataclass(frozen=True)
class Heads:
    """What the network says about B observations."""

    mean: Tensor
    """[B, A] mean of each normalised argument."""
    raw_log_std: Tensor
    """[B, A] log standard deviation before it is bounded."""
    log_std: Tensor
    """[B, A] log standard deviation."""
    value: Tensor
    """[B] expected return."""
    pair_logits: Tensor | None
    """[B, |X|] logits over skill pairs, of the `state` policy only."""


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
        self._compute_with(torch.zeros(parameter_count(self._shapes), device=device))

    def use_float64(self) -> None:
        """Compute in double precision, for comparisons with other implementations."""
        self._compute_with(self.flat.detach().double())

    def _compute_with(self, flat: Tensor) -> None:
        self.flat = flat.requires_grad_()
        """[P] all parameters."""
        self.perceptron = Perceptron(flat, self._shapes)

    def heads(self, outputs: Tensor) -> Heads:
        """Return what the last layer's outputs [B, O] mean."""
        mean, raw_log_std, value, *pair_logits = outputs.split_with_sizes(list(self._heads.values()), dim=1)
        return Heads(
            mean=mean,
            raw_log_std=raw_log_std,
            log_std=raw_log_std.clamp(*LOG_STD_RANGE),
            value=value[:, 0],
            pair_logits=pair_logits[0] if pair_logits else None,
        )

    def terms(self, inputs: Tensor, arguments: Tensor, used: Tensor) -> ActionTerms:
        """Return what the losses need of raw arguments [B, A] in scaled observations [B, D]; see `losses`."""
        terms = _ActionTerms.apply(self.flat, inputs, arguments, used, self)  # type: ignore[no-untyped-call]
        return ActionTerms(*terms)

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


class _ActionTerms(torch.autograd.Function):
    """The layers, the heads' bounds and the Gaussians, from parameters to terms, as one operation."""

    @staticmethod
    def forward(  # noqa: D102
        ctx: Any,  # noqa: ANN401
        flat: Tensor,
        inputs: Tensor,
        arguments: Tensor,
        used: Tensor,
        network: ArgumentNetwork,
    ) -> tuple[Tensor, ...]:
        *activations, outputs = network.perceptron.forward(inputs)
        heads = network.heads(outputs)
        log_probability, entropy, z, inverse_std = gaussian_terms(arguments, heads.mean, heads.log_std, used)
        ctx.perceptron, ctx.activations = network.perceptron, activations
        ctx.gaussians = (z, inverse_std, used)
        ctx.excess = heads.raw_log_std - heads.log_std
        pair_logits = () if heads.pair_logits is None else (heads.pair_logits,)
        return log_probability, entropy, heads.value, *pair_logits

    @staticmethod
    def backward(  # noqa: D102
        ctx: Any,  # noqa: ANN401
        *gradients: Tensor,
    ) -> tuple[Tensor, None, None, None, None]:
        by_log_probability, by_entropy, by_value, *by_pair_logits = gradients
        by_mean, by_log_std = gaussian_gradients(by_log_probability, by_entropy, *ctx.gaussians)
        by_log_std = bounded_gradient(by_log_std, ctx.excess)
        by_outputs = torch.cat([by_mean, by_log_std, by_value[:, None], *by_pair_logits], dim=1)
        return ctx.perceptron.gradient(ctx.activations, by_outputs), None, None, None, None
