"""Random streams keyed by what they are for, never by worker, process or time.

Two processes that ask for the same key get the same numbers; different keys give independent streams
(Philox is a counter-based generator: the key picks the run, the counter the place within it).
"""

import hashlib
from dataclasses import dataclass
from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a stream is for; part of its key, so that adding a use never shifts another's numbers."""

    RESET = 0
    """The task instance of an episode."""
    ACTION = 1
    """Skill pair and arguments of one step."""
    INITIAL_WEIGHTS = 2
    """The network's first weights."""
    MINIBATCHES = 3
    """Permutations of a round's update."""
    AUDIT = 4
    """Searches and samples of an audit."""


@dataclass(frozen=True, order=True)
class EpisodeKey:
    """What makes one episode's randomness: equal keys give equal episodes."""

    seed: int
    """Seed of the run."""
    round: int
    """Round, from 0."""
    slot: int
    """Slot within the round."""
    episode: int
    """Episode within the slot."""
    attempt: int = 0
    """Times the episode was dropped before by a fault of a robot; 0 in simulation."""


def generator(key: EpisodeKey, purpose: Purpose, step: int = 0) -> np.random.Generator:
    """Return the stream of one purpose within one episode, at step 0..T-1."""
    digest = hashlib.sha256(f"taskschema:{key.seed}".encode()).digest()
    counter = [
        0,
        key.round << 32 | key.slot,
        key.episode << 32 | key.attempt,
        step << 32 | int(purpose),
    ]
    philox = np.random.Philox(key=int.from_bytes(digest[:16], "little"), counter=counter)
    return np.random.Generator(philox)


def round_generator(seed: int, round_index: int, purpose: Purpose) -> np.random.Generator:
    """Return the stream of one purpose that belongs to a round as a whole."""
    return generator(EpisodeKey(seed, round_index, slot=0, episode=0), purpose)
