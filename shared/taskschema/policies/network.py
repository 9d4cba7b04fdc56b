"""The argument network as a few numpy products: workers and the API need no torch."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import Float32Array

LOG_STD_RANGE = (-4.0, -1.0)
"""Log standard deviations are clipped to this range [normalised units].

Without the upper end the entropy bonus widens the distribution until most samples are clipped at the ends
of the search space [-1, 1], before there has been any success. At this one, a standard deviation of 0.37,
it is also narrower than the distance between two gripper angles that are equally good, half a turn apart:
a wider one is drawn to both and settles between them (docs/paper.md).
"""


@dataclass(frozen=True)
class NetworkOutput:
    """What the network says about N observations."""

    mean: Float32Array
    """[N, A] mean of each normalised argument."""
    log_std: Float32Array
    """[N, A] log standard deviation."""
    value: Float32Array
    """[N] expected return."""
    pair_logits: Float32Array | None
    """[N, |X|] logits over skill pairs, of the `state` policy only."""


def _dense(inputs: Float32Array, weights: dict[str, Float32Array], layer: str) -> Float32Array:
    """Return inputs [N, I] times the layer's weight [O, I], plus its bias: [N, O].

    Every row is a product of its own, because a product of N rows differs in bits from N products of one:
    an episode's action must not depend on which others share its batch.
    """
    product = np.matmul(inputs[:, None, :], weights[f"{layer}.weight"].T)[:, 0, :]
    result: Float32Array = product + weights[f"{layer}.bias"]
    return result


def forward(weights: dict[str, Float32Array], inputs: Float32Array) -> NetworkOutput:
    """Run the network (paper: an MLP of 4 layers of 64, ReLU, with several heads) on scaled inputs [N, D]."""
    hidden = np.ascontiguousarray(inputs, dtype=np.float32)
    layer = 0
    while f"trunk.{layer}.weight" in weights:
        hidden = np.maximum(_dense(hidden, weights, f"trunk.{layer}"), np.float32(0))
        layer += 1
    return NetworkOutput(
        mean=_dense(hidden, weights, "mean"),
        log_std=np.clip(_dense(hidden, weights, "log_std"), *LOG_STD_RANGE).astype(np.float32),
        value=_dense(hidden, weights, "value")[:, 0],
        pair_logits=_dense(hidden, weights, "pair") if "pair.weight" in weights else None,
    )
