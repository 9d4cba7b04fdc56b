"""Keyed randomness: a stream is a function of its key, and no two keys share one."""

import itertools
import subprocess
import sys

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from taskschema.randomness import EpisodeKey, Purpose, generator, round_generator

counts = st.integers(0, 2**31 - 1)
keys = st.builds(EpisodeKey, st.integers(0, 2**63 - 1), counts, counts, counts, counts)
places = st.tuples(keys, st.sampled_from(Purpose), st.integers(0, 2))


def numbers(place: tuple[EpisodeKey, Purpose, int]) -> list[float]:
    return generator(*place).standard_normal(4).tolist()


@given(places)
def test_equal_keys_give_equal_streams(place: tuple[EpisodeKey, Purpose, int]) -> None:
    assert numbers(place) == numbers(place)


@given(places, places)
def test_different_keys_give_different_streams(
    one: tuple[EpisodeKey, Purpose, int], other: tuple[EpisodeKey, Purpose, int]
) -> None:
    assume(one != other)
    assert numbers(one) != numbers(other)


def test_neighbouring_keys_do_not_overlap() -> None:
    """Long streams of all near keys have no number in common: one does not run into the next."""
    near = itertools.product(range(2), range(2), range(2), range(2), range(2), list(Purpose)[:2], range(2))
    seen: set[int] = set()
    for seed, round_index, slot, episode, attempt, purpose, step in near:
        key = EpisodeKey(seed, round_index, slot, episode, attempt)
        drawn = generator(key, purpose, step).integers(0, 2**64, size=1_000, dtype=np.uint64)
        seen.update(drawn.tolist())
    assert len(seen) == 2**7 * 1_000


def test_streams_are_uncorrelated() -> None:
    draws = np.array(
        [generator(EpisodeKey(0, 0, slot, 0), Purpose.ACTION).random(2_000) for slot in range(20)]
    )
    correlation = np.corrcoef(draws) - np.eye(20)
    assert np.abs(correlation).max() < 5 / np.sqrt(2_000)  # five standard deviations
    assert abs(draws.mean() - 0.5) < 0.01


def test_another_process_draws_the_same_numbers() -> None:
    program = (
        "from taskschema.randomness import *;"
        "print(generator(EpisodeKey(3, 1, 4, 1, 5), Purpose.RESET, 2).random(3).tolist())"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    expected = generator(EpisodeKey(3, 1, 4, 1, 5), Purpose.RESET, 2).random(3).tolist()
    assert printed.stdout.strip() == str(expected)


def test_round_streams_differ_by_round_and_purpose() -> None:
    draws = {
        round_generator(seed, index, purpose).random()
        for seed, index, purpose in itertools.product(range(3), range(3), Purpose)
    }
    assert len(draws) == 9 * len(Purpose)
