"""The paper's Algorithm 1: every success raises what it executed, every failure lowers it."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.config import SchemaConfig
from taskschema.trajectory import Trajectory


class Algorithm1:
    """logit[t, x_t] += alpha for each step of a success, -= beta for each of a failure (lines 9 to 13).

    Summed over the batch. Steps that an episode did not reach, because it succeeded before, get nothing:
    rows behind the step at which episodes succeed stay near uniform and mean nothing.

    A pair that succeeds in a share p of its trials grows while p alpha > (1 - p) beta. beta therefore also
    decides what an early lucky success is worth: pairs that are tried often and succeed less often than
    about beta / alpha fall back.
    """

    name: ClassVar[str] = "algorithm1"

    def __init__(self, config: SchemaConfig) -> None:
        self._config = config

    def update(self, logits: FloatArray, trajectories: Sequence[Trajectory]) -> FloatArray:
        """Return the logits [T, |X|] after the batch."""
        successes = np.zeros(logits.shape, dtype=np.int64)
        failures = np.zeros(logits.shape, dtype=np.int64)
        for trajectory in trajectories:
            counts = successes if trajectory.success else failures
            counts[np.arange(len(trajectory)), trajectory.pairs] += 1
        # counted first: the sum does not depend on the trajectories' order, not even in its last bit
        result: FloatArray = logits + self._config.alpha * successes - self._config.beta * failures
        return result
