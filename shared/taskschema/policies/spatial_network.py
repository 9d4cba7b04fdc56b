"""The spatial network as numpy products, one frame at a time: who acts needs no torch."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import AnyArray, Float32Array
from taskschema.frames import FRAME_SIZE, Frames
from taskschema.policies.frame_convolution import FrameConvolution
from taskschema.policies.network import LOG_STD_RANGE
from taskschema.policies.spatial_layout import CELLS, SpatialLayout
from taskschema.policies.spatial_trunk import (
    CRITIC_SCALE,
    PIXEL_SCALE,
    PIXEL_SHIFT,
    RESPONSE_SCALE,
    TRUNKS,
    maps_layer,
    squeeze_layer,
    table_sampling,
)
from taskschema.skills.pairs import ARMS
from taskschema.skills.table_space import TableRectangle


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
        self._layout = layout
        self._trunk: list[tuple[FrameConvolution, bool]] = []
        size = FRAME_SIZE
        for layer in TRUNKS[trunk]:
            convolution = FrameConvolution(layer, weights, size)
            self._trunk.append((convolution, layer.pooled))
            size = convolution.size // 2 if layer.pooled else convolution.size
        self._squeeze = FrameConvolution(squeeze_layer(trunk), weights, size)
        self._maps = FrameConvolution(maps_layer(layout.map_count), weights, self._squeeze.size)
        self._value = weights["value.weight"][0], weights["value.bias"][0]
        self._log_std = np.clip(weights["log_std"], *LOG_STD_RANGE).astype(np.float32)
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
            response=np.float32(RESPONSE_SCALE) * stacked[:, :arms],
            mean=np.concatenate([offsets, others], axis=2),
            log_std=self._log_std,
            value=np.array(values, dtype=np.float32),
        )

    def _one(self, frame: Frames) -> tuple[Float32Array, Float32Array]:
        """Return the maps [2 + 4 + 2p, 8, 8] and the value of one frame [256, 256, 3]."""
        self.trunk_passes += 1
        pixels = frame.reshape(len(frame), -1).astype(np.float32)
        pixels *= PIXEL_SCALE
        pixels += PIXEL_SHIFT
        hidden: Float32Array = pixels.reshape(frame.shape)
        for convolution, pooled in self._trunk:
            hidden = convolution.rectified(hidden)
            if pooled:
                height, width, channels = hidden.shape
                hidden = hidden.reshape(height // 2, 2, width // 2, 2, channels).max(axis=(1, 3))
        channels_first = np.moveaxis(hidden, 2, 0)
        over_table: AnyArray = self._rows @ channels_first @ self._columns.T
        squeezed = self._squeeze.rectified(np.moveaxis(over_table, 0, 2))
        maps = self._maps(squeezed)
        weight, bias = self._value
        value = weight @ (CRITIC_SCALE * np.moveaxis(squeezed, 2, 0).reshape(-1)) + bias
        return np.moveaxis(maps, 2, 0).copy(), value
