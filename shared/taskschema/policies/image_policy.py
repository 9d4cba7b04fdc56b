"""Acting on frames: the pair is drawn first, then each arm's cell, offset and other arguments."""

from collections.abc import Sequence

import numpy as np

from taskschema.arrays import AnyArray, Float32Array, FloatArray, IntArray
from taskschema.policies.policy import Actions, draw
from taskschema.policies.snapshot import PolicySnapshot
from taskschema.policies.spatial_layout import CELL, CELLS, GRID, OFFSET_X, SpatialLayout
from taskschema.policies.spatial_network import SpatialNetwork, SpatialOutput
from taskschema.schema import softmax
from taskschema.skills.pairs import ARMS
from taskschema.tasks.task import Task


class ImagePolicy:
    """A policy version, ready to act on what the overhead camera sees: no pose, no timestep.

    The step chooses a row of the schema, which does not depend on the frame; the network sees nothing of it.
    """

    def __init__(self, snapshot: PolicySnapshot, task: Task, trunk: str) -> None:
        self.snapshot = snapshot
        self.layout = SpatialLayout(task.image_pairs)
        self._network = SpatialNetwork(snapshot.weights, trunk, self.layout, task.table, task.table_view)
        self._schema_probabilities = softmax(snapshot.logits)

    @property
    def trunk_passes(self) -> int:
        """Frames that the trunk has seen so far."""
        return self._network.trunk_passes

    def act(self, observations: AnyArray, step: int, generators: Sequence[np.random.Generator]) -> Actions:
        """Draw actions for frames [N, 256, 256, 3], all at step 0..T-1, one generator an episode."""
        output = self._network.forward(observations)
        count, arms, gaussians = output.mean.shape[:3]
        uniform = np.array([rng.random(1 + arms) for rng in generators])
        noise = np.stack([rng.standard_normal((arms, gaussians)) for rng in generators])
        pairs = draw(self._pair_probabilities(step, count), uniform[:, 0])
        response = softmax(output.response)
        cells = np.stack([draw(response[:, arm], uniform[:, 1 + arm]) for arm in range(arms)], axis=1)
        drawn = np.exp(output.log_std) * noise.astype(np.float32)
        return self._actions(pairs, cells, _at(output, cells) + drawn)

    def act_mean(self, observations: AnyArray, step: int) -> Actions:
        """Return the most probable pair and cells, and the mean offsets and arguments there."""
        output = self._network.forward(observations)
        cells = output.response.argmax(axis=2)
        pairs = self._pair_probabilities(step, len(cells)).argmax(axis=1)
        return self._actions(pairs, cells, _at(output, cells))

    def response_maps(self, frames: AnyArray) -> FloatArray:
        """Return each arm's distribution over the table for frames [N, 256, 256, 3]: [N, 2, 8, 8].

        The first row has the highest y, the first column the lowest x of the task's `table`.
        """
        output = self._network.forward(frames)
        return softmax(output.response).reshape(len(frames), len(ARMS), GRID, GRID)

    def _pair_probabilities(self, step: int, count: int) -> FloatArray:
        return np.broadcast_to(self._schema_probabilities[step], (count, len(self.layout.pairs)))

    def _actions(self, pairs: IntArray, cells: IntArray, gaussians: Float32Array) -> Actions:
        """Return what pairs [N], cells [N, 2] and the rest [N, 2, 2 + p] amount to."""
        parts = np.empty((len(pairs), len(ARMS), self.layout.arm_size), dtype=np.float32)
        parts[:, :, CELL], parts[:, :, OFFSET_X:] = cells, gaussians
        raw = parts.reshape(len(pairs), self.layout.size)
        used = np.where(self.layout.used[pairs], raw, np.float32(0))
        return Actions(pairs, used, self.layout.to_si(used))


def _at(output: SpatialOutput, cells: IntArray) -> Float32Array:
    """Return the means [N, 2, 2 + p] at cells [N, 2]: arguments are read where the arm goes."""
    assert output.mean.shape[-1] == CELLS
    return np.take_along_axis(output.mean, cells[:, :, None, None], axis=3)[..., 0]
