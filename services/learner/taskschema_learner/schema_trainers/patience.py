"""When a schema that does not become better is given up."""

import numpy as np

from taskschema.arrays import AnyArray, FloatArray, IntArray
from taskschema.schema import softmax

DECIDED = 0.5
"""A schema is on trial while at least this share of the episodes follow it."""
PROGRESS = 1.3
"""The second half of a trial needs this many times the successes of the first half."""
GOOD_ENOUGH = 0.5
"""From this share of successes on a schema needs to become no better."""


class Patience:
    """Watches the schema that most episodes follow (beyond the paper).

    Algorithm 1 reinforces what succeeds, however seldom that is: a schema that now and then succeeds by luck,
    and that no arguments make better, is sampled ever more often and never left. Under a good schema the
    arguments learn, and success grows by half again within a few rounds long before it is frequent. So a
    schema is on trial while the product of its rows' largest probabilities is at least 0.5; if the latter
    half of its last `rounds` rounds has less than 1.3 times the successes of the former, and less than half
    of the episodes succeed, it is given up.
    """

    def __init__(self, rounds: int) -> None:
        """Start without a trial; with 0 rounds nothing is ever given up, as in the paper."""
        self._half = (rounds + 1) // 2
        self._successes: IntArray = np.zeros(0, dtype=np.int64)
        self._given_up = 0

    @property
    def given_up(self) -> int:
        """How many schemas were given up so far."""
        return self._given_up

    def is_exhausted(self, logits: FloatArray, successes: int, episodes: int) -> bool:
        """Take in a round; return whether its schema is to be given up, and begin without a trial then.

        Args:
            logits: [used rows, |X|] that the round was sampled with.
            successes: of its episodes.
            episodes: how many it had.

        """
        if self._half == 0:
            return False
        if softmax(logits).max(axis=-1).prod() < DECIDED:
            self._successes = np.zeros(0, dtype=np.int64)
            return False
        self._successes = np.append(self._successes, successes)[-2 * self._half :]
        if len(self._successes) < 2 * self._half:
            return False
        before, after = self._successes[: self._half].sum(), self._successes[self._half :].sum()
        if after >= PROGRESS * before or after >= GOOD_ENOUGH * episodes * self._half:
            return False
        self._successes = np.zeros(0, dtype=np.int64)
        self._given_up += 1
        return True

    def arrays(self) -> dict[str, AnyArray]:
        """Return what the next rounds depend on, by name."""
        return {"successes": self._successes.copy(), "given_up": np.array(self._given_up, dtype=np.int64)}

    def load(self, arrays: dict[str, AnyArray]) -> None:
        """Take over what `arrays` returned.

        Raises:
            KeyError: if something is missing.

        """
        self._successes = arrays["successes"].astype(np.int64)
        self._given_up = int(arrays["given_up"])
