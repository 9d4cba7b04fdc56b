"""The convolutions of the spatial network: its trunks, and what the maps are made with (paper, Figure 4)."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import Float32Array, FloatArray
from taskschema.frames import FRAME_SIZE
from taskschema.skills.table_space import TableRectangle

FEATURE_GRID = 16
"""Height and width of a trunk's maps, each over the camera's whole view.

The paper speaks of 512 maps of 8 x 8 after VGG's first four blocks; four poolings leave 16 x 16 of 256
pixels, which the next layer's stride of 2 halves.
"""
SQUEEZED = 16
"""Filters of 2 x 2 with stride 2 after the trunk (paper)."""
RESPONSE_SCALE = 8.0
"""Factor on the response maps' logits, beside the other maps.

Without it one success moves the logarithm of its cells' probabilities by 0.03 and that of its offsets and
angles by 0.2, and PPO's clipping ends the move there: where to act was learned last. With 8 both move alike.
"""
CRITIC_SCALE = 1.0 / 16.0
"""Factor on what the critic sees: 16 x 64 numbers, 16 times as many as the network on states shows its own.

Each of Adam's steps moves every weight by the learning rate. Without the factor one step moved all values by
as much as half a success, and what the policy followed between two successes was the critic's noise.
"""
IMAGENET_MEAN = (0.485, 0.456, 0.406)
"""Of red, green and blue, for pixels from 0 to 1: what VGG's published weights expect."""
IMAGENET_STD = (0.229, 0.224, 0.225)
PIXEL_SCALE: Float32Array = np.tile(1.0 / (255.0 * np.array(IMAGENET_STD)), FRAME_SIZE).astype(np.float32)
PIXEL_SHIFT: Float32Array = np.tile(-np.array(IMAGENET_MEAN) / np.array(IMAGENET_STD), FRAME_SIZE).astype(
    np.float32
)
"""[768] a network's input is pixel * scale + shift, pixels from 0 to 255: over a frame's whole row at once,
which is ten times as fast as over its three colours."""


@dataclass(frozen=True)
class Convolution:
    """One convolution, ReLU after it."""

    name: str
    inputs: int
    outputs: int
    kernel: int
    """Height and width [pixel]."""
    stride: int = 1
    padding: int = 0
    """Zeros around the input [pixel]."""
    dilation: int = 1
    pooled: bool = False
    """Whether a 2 x 2 max-pool follows."""

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """[O, I, k, k] of its weight."""
        return (self.outputs, self.inputs, self.kernel, self.kernel)


def _vgg16() -> tuple[Convolution, ...]:
    """Return VGG16's first four blocks: 2, 2, 3 and 3 convolutions, a max-pool after each block."""
    layers: list[Convolution] = []
    inputs = 3
    for outputs, count in ((64, 2), (128, 2), (256, 3), (512, 3)):
        for position in range(count):
            name = f"trunk.{len(layers)}"
            layers.append(Convolution(name, inputs, outputs, 3, padding=1, pooled=position == count - 1))
            inputs = outputs
    return tuple(layers)


TRUNKS: dict[str, tuple[Convolution, ...]] = {
    "small": (
        Convolution("trunk.0", 3, 16, 4, stride=4),
        Convolution("trunk.1", 16, 32, 3, stride=2, padding=1),
        Convolution("trunk.2", 32, 32, 3, stride=2, padding=1),
        Convolution("trunk.3", 32, 32, 3, padding=2, dilation=2),
        Convolution("trunk.4", 32, 32, 3, padding=4, dilation=4),
    ),
    "vgg16": _vgg16(),
}
"""By name. The small one's dilations let every cell see most of the table: where a bar's middle is shows
only at its ends."""


def squeeze_layer(trunk: str) -> Convolution:
    """Return the layer after the trunk: 16 filters of 2 x 2, stride 2, which leaves 16 maps of 8 x 8."""
    return Convolution("squeeze", TRUNKS[trunk][-1].outputs, SQUEEZED, 2, stride=2)


def maps_layer(map_count: int) -> Convolution:
    """Return the last layer: 2 + 4 + 2p filters with stride 1, one map for each."""
    return Convolution("maps", SQUEEZED, map_count, 1)


def table_sampling(rectangle: TableRectangle, view: float) -> tuple[Float32Array, Float32Array]:
    """Return what reads feature maps off where the response map's cells lie on the table.

    The camera sees more than the rectangle, since the ends of a long bar say where its middle is; a map over
    the rectangle is therefore interpolated (bilinearly) from the trunk's maps over the whole view.

    Args:
        rectangle: that the response map covers.
        view: edge length of the square of table that a frame shows [m].

    Returns:
        Rows [16, 16] and columns [16, 16]: sampled = rows @ features @ columns.T.
    """
    place = (np.arange(FEATURE_GRID) + 0.5) / FEATURE_GRID
    x = rectangle.x[0] + place * (rectangle.x[1] - rectangle.x[0])
    y = rectangle.y[1] - place * (rectangle.y[1] - rectangle.y[0])
    rows = _interpolation((0.5 - y / view) * FEATURE_GRID - 0.5)
    columns = _interpolation((x / view + 0.5) * FEATURE_GRID - 0.5)
    return rows, columns


def _interpolation(places: FloatArray) -> Float32Array:
    """Return weights [K, 16] that interpolate between 16 values at places [K] counted from the first."""
    inside = np.clip(places, 0.0, FEATURE_GRID - 1.0)
    distance = np.abs(inside[:, None] - np.arange(FEATURE_GRID))
    return np.maximum(1.0 - distance, 0.0).astype(np.float32)
