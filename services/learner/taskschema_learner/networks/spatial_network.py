"""The spatial network in torch: the trainable twin of `taskschema.policies.spatial_network`."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from taskschema.arrays import AnyArray, Float32Array
from taskschema.config import ImageConfig
from taskschema.policies.network import LOG_STD_RANGE
from taskschema.policies.spatial_layout import CELL, CELLS, OFFSET_X, SpatialLayout
from taskschema.policies.spatial_trunk import (
    CRITIC_SCALE,
    PIXEL_SCALE,
    PIXEL_SHIFT,
    RESPONSE_SCALE,
    SQUEEZED,
    TRUNKS,
    Convolution,
    maps_layer,
    squeeze_layer,
    table_sampling,
)
from taskschema.skills.pairs import ARMS
from taskschema.tasks.task import Task
from taskschema_learner.networks.bounds import bounded
from taskschema_learner.update.action_terms import ActionTerms
from taskschema_learner.update.losses import argument_terms
from taskschema_learner.update.parallel_parts import ParallelParts

FRAMES_AT_ONCE = 8
"""Frames that pass the network together; it bounds memory, and more of them are slower."""


SPREAD_ENTROPY = math.log(8.0)
"""Of an arm's response map [nat]: what is spread more evenly, as over 8 of 64 cells, is not spread further.

Successes are rare at first, and the entropy bonus is at work in every minibatch: without this end it has made
a map even again before the next success. The Gaussians have such an end, too: `LOG_STD_RANGE`.
"""


@dataclass(frozen=True)
class SpatialEvaluation:
    """What the network says about B frames, as tensors that carry gradients."""

    response: Tensor
    """[B, 2, 64] logits of each arm's location."""
    mean: Tensor
    """[B, 2, 2 + p, 64] means of the offsets and of the other arguments, cell by cell."""
    log_std: Tensor
    """[2, 2 + p]"""
    value: Tensor
    """[B] expected return."""

    def argument_terms(self, arguments: Tensor, used: Tensor) -> tuple[Tensor, Tensor]:
        """Return log-density [B] and entropy [B, nat] of the mixed actions: cells and what is read there.

            log p = sum_arms  u_cell log P(c)  +  sum_i u_i log N(a_i; mean_i(c), std_i)
            H     = sum_arms  u_cell H(P)      +  sum_i u_i (log std_i + log(2 pi e) / 2)

        The standard deviations are the same in all cells, so the second sum is the Gaussians' expected
        entropy over the cells, exactly. H(P) has no gradient above `SPREAD_ENTROPY`.

        Args:
            arguments: [B, R] raw actions, see `SpatialLayout`.
            used: [B, R] 1 where the pair's skills use a number, else 0.

        """
        parts = arguments.view(len(arguments), len(ARMS), -1)
        used_parts = used.view(parts.shape)
        cells = parts[..., CELL].long()
        logs = torch.log_softmax(self.response, dim=2)
        used_cells = used_parts[..., CELL]
        of_cells = (logs.gather(2, cells[..., None])[..., 0] * used_cells).sum(dim=1)
        exact = -(logs.exp() * logs).sum(dim=2)
        spreading = torch.where(exact < SPREAD_ENTROPY, exact, exact.detach())
        cell_entropy = (spreading * used_cells).sum(dim=1)
        index = cells[:, :, None, None].expand(-1, -1, self.mean.shape[2], 1)
        mean = self.mean.gather(3, index)[..., 0].flatten(1)
        log_std = self.log_std.flatten().expand_as(mean)
        of_gaussians, entropy = argument_terms(
            parts[..., OFFSET_X:].flatten(1), mean, log_std, used_parts[..., OFFSET_X:].flatten(1)
        )
        return of_cells + of_gaussians, cell_entropy + entropy


class SpatialNetwork:
    """A fully convolutional network (paper, Figure 4) with a critic on its 16 maps.

    Trained parameters are views of one flat vector; a frozen trunk is not part of it.
    """

    def __init__(self, task: Task, config: ImageConfig, device: str = "cpu") -> None:
        """Build the network with all weights zero.

        Args:
            task: what is seen and done.
            config: which trunk.
            device: `cpu` or `cuda`.

        """
        layout = SpatialLayout(task.image_pairs)
        self._trunk = TRUNKS[config.trunk]
        self._squeeze, self._maps = squeeze_layer(config.trunk), maps_layer(layout.map_count)
        self._frozen = config.trunk_is_frozen
        trained = [self._squeeze, self._maps] if self._frozen else [*self._trunk, self._squeeze, self._maps]
        self._shapes = layer_shapes(trained) | head_shapes(len(layout.others))
        sizes = [math.prod(shape) for shape in self._shapes.values()]
        self.flat = torch.zeros(sum(sizes), device=device, requires_grad=True)
        """[P] all trained parameters."""
        self._fixed = {
            name: torch.zeros(shape, device=device)
            for name, shape in (layer_shapes(self._trunk) if self._frozen else {}).items()
        }
        rows, columns = table_sampling(task.table, task.table_view)
        self._rows, self._columns, self._scale, self._shift = (
            torch.from_numpy(item).to(device) for item in (rows, columns, PIXEL_SCALE, PIXEL_SHIFT)
        )
        threads = None if device == "cpu" else 1
        self._parts = ParallelParts(self._maps_of, FRAMES_AT_ONCE, threads)
        self.trunk_passes = 0
        """Frames that the trunk has seen so far."""

    def inputs(self, observations: AnyArray) -> Tensor:
        """Return what an update keeps of frames [B, 256, 256, 3]: a frozen trunk's maps, else the frames."""
        frames = torch.from_numpy(np.ascontiguousarray(observations))
        if not self._frozen:
            return frames.to(self.flat.device)
        self.trunk_passes += len(frames)
        return torch.cat(self._parts.map(self._fixed_features, self._parts.split(frames)))

    def __call__(self, inputs: Tensor) -> SpatialEvaluation:
        """Run the network on what `inputs` returned, [B, ...]."""
        squeezed, maps = self._parts(self.flat, inputs)
        weights, arms, count = self._views(self.flat), len(ARMS), len(inputs)
        if not self._frozen:
            self.trunk_passes += count
        flat = maps.flatten(2)
        offsets = flat[:, arms : 3 * arms].reshape(count, arms, 2, CELLS)
        others = flat[:, 3 * arms :].reshape(count, arms, -1, CELLS)
        seen = CRITIC_SCALE * squeezed.flatten(1)
        value = functional.linear(seen, weights["value.weight"], weights["value.bias"])
        return SpatialEvaluation(
            response=RESPONSE_SCALE * flat[:, :arms],
            mean=torch.cat([offsets, others], dim=2),
            log_std=bounded(weights["log_std"], *LOG_STD_RANGE),
            value=value[:, 0],
        )

    def terms(self, inputs: Tensor, arguments: Tensor, used: Tensor) -> ActionTerms:
        """Return what the losses need of raw actions [B, R] on what `inputs` returned, [B, ...]."""
        evaluation = self(inputs)
        return ActionTerms(*evaluation.argument_terms(arguments, used), evaluation.value)

    def _maps_of(self, flat: Tensor, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """Return 16 maps of 8 x 8 of some frames, or of their features, and the 2 + 4 + 2p made of them."""
        weights = self._views(flat)
        features = inputs if self._frozen else self._features(inputs, weights)
        sampled = self._rows @ features @ self._columns.T
        squeezed = _convolve(sampled, self._squeeze, weights).relu()
        return squeezed, _convolve(squeezed, self._maps, weights)

    def _fixed_features(self, frames: Tensor) -> Tensor:
        """Return a frozen trunk's maps of frames, without a graph behind them."""
        with torch.no_grad():
            return self._features(frames.to(self.flat.device), self._fixed)

    def _features(self, frames: Tensor, weights: dict[str, Tensor]) -> Tensor:
        """Return the trunk's maps [B, C, 16, 16] of frames [B, 256, 256, 3]."""
        rows = frames.flatten(2).to(torch.float32).mul_(self._scale).add_(self._shift)
        hidden = rows.view(frames.shape).permute(0, 3, 1, 2)
        for layer in self._trunk:
            hidden = _convolve(hidden, layer, weights).relu()
            if layer.pooled:
                hidden = functional.max_pool2d(hidden, 2)
        return hidden

    def _views(self, flat: Tensor) -> dict[str, Tensor]:
        """Return the trained parameters by name, as views of all of them [P]."""
        sizes = [math.prod(shape) for shape in self._shapes.values()]
        parts = torch.split(flat, sizes)
        return {
            name: part.view(shape) for part, (name, shape) in zip(parts, self._shapes.items(), strict=True)
        }

    def _named(self) -> dict[str, Tensor]:
        return {name: view.detach() for name, view in (self._fixed | self._views(self.flat)).items()}

    def weights(self) -> dict[str, Float32Array]:
        """Return copies of all weights by name, as `taskschema.policies.SpatialNetwork` takes them."""
        return {name: view.cpu().numpy().astype(np.float32) for name, view in self._named().items()}

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


def layer_shapes(layers: list[Convolution] | tuple[Convolution, ...]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of convolutions' weights and biases by name."""
    shapes: dict[str, tuple[int, ...]] = {}
    for layer in layers:
        shapes[f"{layer.name}.weight"], shapes[f"{layer.name}.bias"] = layer.shape, (layer.outputs,)
    return shapes


def head_shapes(others: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of what stands beside the convolutions, for p other arguments an arm."""
    return {
        "log_std": (len(ARMS), 2 + others),
        "value.weight": (1, SQUEEZED * CELLS),
        "value.bias": (1,),
    }


def _convolve(inputs: Tensor, layer: Convolution, weights: dict[str, Tensor]) -> Tensor:
    return functional.conv2d(
        inputs,
        weights[f"{layer.name}.weight"],
        weights[f"{layer.name}.bias"],
        stride=layer.stride,
        padding=layer.padding,
        dilation=layer.dilation,
    )
