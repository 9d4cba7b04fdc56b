"""One convolution of one frame as a matrix product, in memory of its own that every frame reuses."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from taskschema.arrays import Float32Array
from taskschema.policies.spatial_trunk import Convolution

ROWS_AT_ONCE = 32
"""Rows of an output computed together; it bounds memory."""


class FrameConvolution:
    """A convolution of arrays [S, S, I], one at a time.

    Asking for memory frame by frame takes longer than the products.

    Args:
        layer: what it is.
        weights: the network's, by name.
        size: S, height and width of the input.

    """

    def __init__(self, layer: Convolution, weights: dict[str, Float32Array], size: int) -> None:
        filters = np.moveaxis(weights[f"{layer.name}.weight"], 1, 3).reshape(layer.outputs, -1)
        self._matrix = np.ascontiguousarray(filters.T)  # [k k I, O], the channels running fastest
        self._bias = weights[f"{layer.name}.bias"]
        side, reach = size + 2 * layer.padding, layer.dilation * (layer.kernel - 1) + 1
        padded = np.zeros((side, side, layer.inputs), dtype=np.float32)
        self._inside = padded[layer.padding : layer.padding + size, layer.padding : layer.padding + size]
        windows = np.moveaxis(sliding_window_view(padded, (reach, reach), axis=(0, 1)), 2, 4)
        self._windows = windows[:: layer.stride, :: layer.stride, :: layer.dilation, :: layer.dilation]
        self.size: int = self._windows.shape[0]
        """Height and width of the output."""
        rows = min(ROWS_AT_ONCE, self.size)
        self._patches = np.empty((rows, *self._windows.shape[1:]), dtype=np.float32)
        self._output = np.empty((self.size, self.size, layer.outputs), dtype=np.float32)

    def __call__(self, inputs: Float32Array) -> Float32Array:
        """Return the output [S', S', O], without a ReLU; the next call overwrites it."""
        self._inside[:] = inputs
        for start in range(0, self.size, ROWS_AT_ONCE):
            windows = self._windows[start : start + ROWS_AT_ONCE]
            patches = self._patches[: len(windows)]
            patches[:] = windows
            output = self._output[start : start + len(windows)].reshape(-1, len(self._bias))
            np.matmul(patches.reshape(len(output), -1), self._matrix, out=output)
        self._output += self._bias
        return self._output

    def rectified(self, inputs: Float32Array) -> Float32Array:
        """Return the output [S', S', O] after a ReLU; the next call overwrites it."""
        output = self(inputs)
        return np.maximum(output, np.float32(0), out=output)
