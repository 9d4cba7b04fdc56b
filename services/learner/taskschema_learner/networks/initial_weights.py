"""The first weights of a network."""

import math

import numpy as np
from threadpoolctl import threadpool_limits

from taskschema.arrays import Float32Array, FloatArray
from taskschema.config import NetworkConfig, RunConfig
from taskschema.policies.spatial_layout import SpatialLayout
from taskschema.policies.spatial_trunk import TRUNKS, maps_layer, squeeze_layer
from taskschema.randomness import Purpose, round_generator
from taskschema.tasks.task import Task
from taskschema_learner.networks.spatial_network import head_shapes

TRUNK_GAIN = math.sqrt(2.0)
ACTOR_GAIN = 0.01
"""Initial gain of the actor's heads (Stable Baselines): every state starts with nearly the same actions."""


def first_weights(
    config: RunConfig, task: Task, published: dict[str, Float32Array] | None = None
) -> dict[str, Float32Array]:
    """Return the weights that a run's seed draws for its network; `published`: see below."""
    rng = round_generator(config.seed, 0, Purpose.INITIAL_WEIGHTS)
    if config.observation == "image":
        return initial_spatial_weights(rng, config, task, published)
    pairs = len(task.pairs) if config.policy == "state" else 0
    return initial_weights(rng, task.observation.size, config.network, task.pairs.argument_count, pairs)


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


def initial_spatial_weights(
    rng: np.random.Generator,
    config: RunConfig,
    task: Task,
    published: dict[str, Float32Array] | None = None,
) -> dict[str, Float32Array]:
    """Return a spatial network's first weights: as `initial_weights`, each filter a row.

    Args:
        rng: draws them.
        config: of a run on images.
        task: what is seen and done.
        published: the trunk's weights where they are known; the rest is the same with and without them.

    """
    layout = SpatialLayout(task.image_pairs)
    trunk = config.image.trunk
    layers = [(squeeze_layer(trunk), TRUNK_GAIN), (maps_layer(layout.map_count), ACTOR_GAIN)]
    if published is None:
        layers += [(layer, TRUNK_GAIN) for layer in TRUNKS[trunk]]
    weights: dict[str, Float32Array] = {}
    for layer, gain in layers:
        outputs, *inputs = layer.shape
        filters = gain * _orthogonal(rng, outputs, math.prod(inputs))
        weights[f"{layer.name}.weight"] = filters.reshape(layer.shape).astype(np.float32)
        weights[f"{layer.name}.bias"] = np.zeros(outputs, dtype=np.float32)
    for name, shape in head_shapes(len(layout.others)).items():
        weights[name] = np.zeros(shape, dtype=np.float32)
    weights["log_std"] += np.float32(config.network.initial_log_std)
    return weights | (published or {})


def _orthogonal(rng: np.random.Generator, rows: int, columns: int) -> FloatArray:
    """Return a random [rows, columns] matrix whose shorter side is orthonormal."""
    tall = rng.standard_normal((max(rows, columns), min(rows, columns)))
    with threadpool_limits(limits=1):  # more take ten times as long on busy cores, with the same bits
        q, r = np.linalg.qr(tall)
    q = q * np.sign(np.diag(r))  # makes the distribution uniform over orthogonal matrices
    result: FloatArray = q if rows >= columns else q.T
    return result
