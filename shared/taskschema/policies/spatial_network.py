"""The spatial network as numpy products, one frame at a time: who acts needs no torch."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from taskschema.arrays import AnyArray, Float32Array
from taskschema.frames import Frames
from taskschema.policies.network import LOG_STD_RANGE
from taskschema.policies.spatial_layout import CELLS, SpatialLayout
from taskschema.policies.spatial_trunk import (
    IMAGENET_MEAN,
    IMAGENET_STD,
    TRUNKS,
    Convolution,
    maps_layer,
    squeeze_layer,
    table_sampling,
)
from taskschema.skills.pairs import ARMS
from taskschema.skills.table_space import TableRectangle

ROWS_AT_ONCE = 32
"""Rows of an output computed together; it bounds memory."""


@dataclass(frozen=True)
class SpatialOutput:
    """What the network says about N frames, cell by cell of the table."""

    response: Float32Array
    """[N, 2, 64] logits of each arm's location."""
    mean: Float32Array
    """[N, 2, 2 + p, 64] means of the offsets and of the other arguments."""
    log_std: Float32Array
    """[2, 2 + p] log standard deviations: parameters of their own, the same for all frames and cells."""
    value: Float32Array
    """[N] expected return."""


class SpatialNetwork:
    """The network of one policy version, ready to run on frames."""

    def __init__(
        self,
        weights: dict[str, Float32Array],
        trunk: str,
        layout: SpatialLayout,
        rectangle: TableRectangle,
        view: float,
    ) -> None:
        self._weights = weights
        self._layout = layout
        self._trunk = TRUNKS[trunk]
        self._squeeze, self._maps = squeeze_layer(trunk), maps_layer(layout.map_count)
        self._rows, self._columns = table_sampling(rectangle, view)
        self.trunk_passes = 0
        """Frames that the trunk has seen so far."""

    def forward(self, frames: Frames) -> SpatialOutput:
        """Run on frames [N, 256, 256, 3].

        Every frame is computed by itself: what a policy does must not depend on who shares its batch.
        """
        maps, values = zip(*(self._one(frame) for frame in frames), strict=True)
        stacked = np.stack(maps).reshape(len(frames), self._layout.map_count, CELLS)
        arms = len(ARMS)
        offsets = stacked[:, arms : 3 * arms].reshape(len(frames), arms, 2, CELLS)
        others = stacked[:, 3 * arms :].reshape(len(frames), arms, -1, CELLS)
        return SpatialOutput(
            response=stacked[:, :arms],
            mean=np.concatenate([offsets, others], axis=2),
            log_std=np.clip(self._weights["log_std"], *LOG_STD_RANGE).astype(np.float32),
            value=np.array(values, dtype=np.float32),
        )

    def _one(self, frame: Frames) -> tuple[Float32Array, Float32Array]:
        """Return the maps [2 + 4 + 2p, 8, 8] and the value of one frame [256, 256, 3]."""
        self.trunk_passes += 1
        pixels = frame.astype(np.float32) / np.float32(255)
        mean, std = (np.array(values, dtype=np.float32) for values in (IMAGENET_MEAN, IMAGENET_STD))
        hidden: Float32Array = (pixels - mean) / std
        for layer in self._trunk:
            hidden = np.maximum(_convolve(hidden, layer, self._weights), np.float32(0))
            if layer.pooled:
                height, width, channels = hidden.shape
                hidden = hidden.reshape(height // 2, 2, width // 2, 2, channels).max(axis=(1, 3))
        channels_first = np.moveaxis(hidden, 2, 0)
        over_table: AnyArray = self._rows @ channels_first @ self._columns.T
        sampled: Float32Array = np.moveaxis(over_table, 0, 2)
        squeezed = np.maximum(_convolve(sampled, self._squeeze, self._weights), np.float32(0))
        maps = _convolve(squeezed, self._maps, self._weights)
        flat = np.moveaxis(squeezed, 2, 0).reshape(-1)
        value = self._weights["value.weight"][0] @ flat + self._weights["value.bias"][0]
        return np.moveaxis(maps, 2, 0), value


def _convolve(inputs: Float32Array, layer: Convolution, weights: dict[str, Float32Array]) -> Float32Array:
    """Return a convolution [H', W', O] of inputs [H, W, I], some rows at a time."""
    pad = layer.padding
    padded = np.pad(inputs, ((pad, pad), (pad, pad), (0, 0)))
    reach = layer.dilation * (layer.kernel - 1) + 1
    windows = sliding_window_view(padded, (reach, reach), axis=(0, 1))
    windows = windows[:: layer.stride, :: layer.stride, :, :: layer.dilation, :: layer.dilation]
    matrix = weights[f"{layer.name}.weight"].reshape(layer.outputs, -1).T
    parts = [
        windows[start : start + ROWS_AT_ONCE].reshape(-1, windows.shape[1], matrix.shape[0]) @ matrix
        for start in range(0, len(windows), ROWS_AT_ONCE)
    ]
    result: Float32Array = np.concatenate(parts) + weights[f"{layer.name}.bias"]
    return result
