"""Acting: the pair is drawn first, then the arguments of its skills (paper, section III and Figure 3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from taskschema.arrays import AnyArray, Float32Array, FloatArray, IntArray
from taskschema.observation import ObservationLayout
from taskschema.policies.network import forward
from taskschema.policies.snapshot import PolicySnapshot
from taskschema.schema import softmax
from taskschema.skills.pairs import PairSpace


@dataclass(frozen=True)
class Actions:
    """What to do in N episodes."""

    pairs: IntArray
    """[N] skill pair."""
    raw: Float32Array
    """[N, A] raw Gaussian samples in normalised units, 0 where the pair does not use the argument; on images
    [N, R], see `SpatialLayout`."""
    arguments: FloatArray
    """[N, A] the same in SI units, clipped or wrapped into the search spaces."""


class Actor(Protocol):
    """Whatever acts: a policy version, or a scripted expert."""

    def act(self, observations: AnyArray, step: int, generators: Sequence[np.random.Generator]) -> Actions:
        """Draw actions for N observations, all at step 0..T-1, one generator an episode."""
        ...


class ActingPolicy(Actor, Protocol):
    """A policy version that acts, whatever it observes."""

    @property
    def snapshot(self) -> PolicySnapshot:
        """The version."""
        ...

    def act_mean(self, observations: AnyArray, step: int) -> Actions:
        """Return the most probable actions."""
        ...


class Policy:
    """A policy version, ready to act on observations of its task."""

    def __init__(self, snapshot: PolicySnapshot, pairs: PairSpace, observation: ObservationLayout) -> None:
        self.snapshot = snapshot
        self._pairs = pairs
        self._observation = observation
        self._schema_probabilities = softmax(snapshot.logits)

    def act(self, observations: AnyArray, step: int, generators: Sequence[np.random.Generator]) -> Actions:
        """Draw actions for SI observations [N, D], all at step 0..T-1, one generator an episode."""
        output = forward(self.snapshot.weights, self._observation.to_network(observations))
        probabilities = self._pair_probabilities(output.pair_logits, len(observations), step)
        uniform = np.array([rng.random() for rng in generators])
        noise = np.stack([rng.standard_normal(self._pairs.argument_count) for rng in generators])
        pairs = draw(probabilities, uniform)
        raw = output.mean + np.exp(output.log_std) * noise.astype(np.float32)
        return self._actions(pairs, raw)

    def act_mean(self, observations: AnyArray, step: int) -> Actions:
        """Return the most probable pair and the mean arguments."""
        output = forward(self.snapshot.weights, self._observation.to_network(observations))
        probabilities = self._pair_probabilities(output.pair_logits, len(observations), step)
        return self._actions(probabilities.argmax(axis=-1), output.mean)

    def _pair_probabilities(self, pair_logits: Float32Array | None, count: int, step: int) -> FloatArray:
        if pair_logits is not None:
            return softmax(pair_logits)
        return np.broadcast_to(self._schema_probabilities[step], (count, len(self._pairs)))

    def _actions(self, pairs: IntArray, raw: Float32Array) -> Actions:
        used = np.where(self._pairs.used[pairs], raw, np.float32(0)).astype(np.float32)
        return Actions(pairs, used, self._pairs.to_si(used))


def draw(probabilities: FloatArray, uniform: FloatArray) -> IntArray:
    """Invert the cumulative distribution of each row [N, |X|] at uniform [N]; never draws what has 0."""
    cumulative = probabilities.cumsum(axis=-1)
    threshold = uniform * cumulative[:, -1]
    index: IntArray = (cumulative <= threshold[:, None]).sum(axis=-1)
    return index
