"""The argument network in torch: the trainable twin of `taskschema.policies.network`."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import nn

from taskschema.arrays import AnyArray, Float32Array, FloatArray
from taskschema.config import NetworkConfig
from taskschema.policies.network import LOG_STD_RANGE

TRUNK_GAIN = math.sqrt(2.0)
ACTOR_GAIN = 0.01
"""Initial gain of the actor's heads (Stable Baselines): every state starts with nearly the same actions."""


class _Bounded(torch.autograd.Function):
    """Clamping whose gradient vanishes only where it pushes further out.

    The entropy bonus then cannot drive a bounded value away behind its bound, from where nothing would
    bring it back.
    """

    @staticmethod
    def forward(ctx: Any, values: torch.Tensor, low: float, high: float) -> torch.Tensor:  # noqa: ANN401
        """Return values limited to [low, high]."""
        ctx.save_for_backward(values)
        ctx.bounds = (low, high)
        return values.clamp(low, high)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None, None]:  # noqa: ANN401
        """Return the gradient, 0 where descending it would leave the bounds."""
        (values,) = ctx.saved_tensors
        low, high = ctx.bounds
        outward = ((values >= high) & (gradients[0] < 0)) | ((values <= low) & (gradients[0] > 0))
        return gradients[0].masked_fill(outward, 0.0), None, None


@dataclass(frozen=True)
class Evaluation:
    """What the network says about B observations, as tensors that carry gradients."""

    mean: torch.Tensor
    """[B, A] mean of each normalised argument."""
    log_std: torch.Tensor
    """[B, A] log standard deviation."""
    value: torch.Tensor
    """[B] expected return."""
    pair_logits: torch.Tensor | None
    """[B, |X|] logits over skill pairs, of the `state` policy only."""


class ArgumentNetwork(nn.Module):
    """An MLP of 4 layers of 64, ReLU, with heads for the actor and the critic (paper, section IV-A).

    Mean *and* variance of every argument depend on the state (section III). The heads are the rows of one
    matrix, and all parameters and gradients are views of two flat vectors: minibatches are so small that
    the number of operations decides how long an update takes.
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
        super().__init__()
        sizes = [inputs, *hidden]
        self.trunk = nn.ModuleList(
            nn.Linear(i, o, device=device) for i, o in zip(sizes, sizes[1:], strict=False)
        )
        self._heads = {"mean": arguments, "log_std": arguments, "value": 1} | (
            {"pair": pairs} if pairs else {}
        )
        self.heads = nn.Linear(sizes[-1], sum(self._heads.values()), device=device)
        self._flatten(torch.float32)

    def _flatten(self, dtype: torch.dtype) -> None:
        """Make all parameters and their gradients views of `flat` and of its gradient."""
        parameters = [*self.trunk.parameters(), *self.heads.parameters()]
        values = torch.cat([parameter.detach().reshape(-1) for parameter in parameters]).to(dtype)
        self.flat = [nn.Parameter(values)]  # in a list: it is no parameter of its own
        self.gradient = torch.zeros_like(values)
        self.flat[0].grad = self.gradient
        start = 0
        for parameter in parameters:
            end = start + parameter.numel()
            parameter.data = self.flat[0].data[start:end].view_as(parameter)
            parameter.grad = self.gradient[start:end].view_as(parameter)
            start = end

    def use_float64(self) -> None:
        """Compute in double precision, for comparisons with other implementations."""
        self._flatten(torch.float64)

    def forward(self, inputs: torch.Tensor) -> Evaluation:
        """Run the network on scaled observations [B, D]."""
        hidden = inputs
        for layer in self.trunk:
            hidden = torch.relu(layer(hidden))
        outputs = self.heads(hidden).split(list(self._heads.values()), dim=1)
        return Evaluation(
            mean=outputs[0],
            log_std=_Bounded.apply(outputs[1], *LOG_STD_RANGE),  # type: ignore[no-untyped-call]
            value=outputs[2][:, 0],
            pair_logits=outputs[3] if len(outputs) > 3 else None,
        )

    def _named(self) -> dict[str, torch.Tensor]:
        """Return views of the parameters under the names that they travel by."""
        views = {f"trunk.{name}": parameter.data for name, parameter in self.trunk.named_parameters()}
        sizes = list(self._heads.values())
        weights = torch.split(self.heads.weight.data, sizes)
        biases = torch.split(self.heads.bias.data, sizes)
        for name, weight, bias in zip(self._heads, weights, biases, strict=True):
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


def initial_weights(
    rng: np.random.Generator, inputs: int, config: NetworkConfig, arguments: int, pairs: int = 0
) -> dict[str, Float32Array]:
    """Return a network's first weights: orthogonal, biases zero, as in Stable Baselines.

    Two things differ (see docs/paper.md). The bias of the log standard deviation is `config.initial_log_std`.
    The critic's head is zero: no return is expected before there was one, so until the first success all
    advantages are exactly 0 and the policy does not follow the noise of random values.

    Arguments as in `ArgumentNetwork`.
    """
    sizes = [inputs, *config.hidden]
    shapes = {f"trunk.{n}": (sizes[n + 1], sizes[n], TRUNK_GAIN) for n in range(len(config.hidden))}
    shapes["mean"] = (arguments, sizes[-1], ACTOR_GAIN)
    shapes["log_std"] = (arguments, sizes[-1], ACTOR_GAIN)
    if pairs:
        shapes["pair"] = (pairs, sizes[-1], ACTOR_GAIN)
    weights: dict[str, Float32Array] = {}
    for name, (rows, columns, gain) in shapes.items():
        weights[f"{name}.weight"] = (gain * _orthogonal(rng, rows, columns)).astype(np.float32)
        weights[f"{name}.bias"] = np.zeros(rows, dtype=np.float32)
    weights["value.weight"] = np.zeros((1, sizes[-1]), dtype=np.float32)
    weights["value.bias"] = np.zeros(1, dtype=np.float32)
    weights["log_std.bias"] += np.float32(config.initial_log_std)
    return weights


def _orthogonal(rng: np.random.Generator, rows: int, columns: int) -> FloatArray:
    """Return a random [rows, columns] matrix whose shorter side is orthonormal."""
    tall = rng.standard_normal((max(rows, columns), min(rows, columns)))
    q, r = np.linalg.qr(tall)
    q = q * np.sign(np.diag(r))  # makes the distribution uniform over orthogonal matrices
    result: FloatArray = q if rows >= columns else q.T
    return result
