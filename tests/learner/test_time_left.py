"""The estimate of the time left."""

import math
from types import SimpleNamespace

import pytest

from taskschema_learner.runs.progress import Limits
from taskschema_learner.views.time_left import seconds_left, words


def rows(successes, seconds=2.0):
    return [
        SimpleNamespace(
            policy_version=number + 1,
            success_last_100=success,
            seconds_collect=seconds,
            seconds_update=0.0,
            seconds_checkpoint=0.0,
        )
        for number, success in enumerate(successes)
    ]


def test_rounds_that_are_limited_are_counted():
    # 3 of 10 rounds done at 2 s each: 7 * 2 s = 14 s.
    assert seconds_left(rows([0, 0, 0]), Limits(until_success=None, rounds=10)) == pytest.approx(14)


def test_nothing_is_known_before_success_grows():
    assert seconds_left([], Limits()) is None
    assert seconds_left(rows([0.0] * 10), Limits()) is None
    assert seconds_left(rows([0.3] * 10), Limits()) is None
    assert seconds_left(rows([0.6, 0.5, 0.4]), Limits()) is None


def test_logistic_growth_is_extrapolated():
    # Log odds grow by 0.5 a round, from -2 to 0 in the last row: ln 9 = 2.197 is 4.394 rounds away.
    successes = [1 / (1 + math.exp(-odds)) for odds in (-2.0, -1.5, -1.0, -0.5, 0.0)]
    assert seconds_left(rows(successes), Limits()) == pytest.approx(2.0 * math.log(9) / 0.5)
    # A limit of rounds that comes first counts: 7 - 5 = 2 rounds of 2 s.
    assert seconds_left(rows(successes), Limits(rounds=7)) == pytest.approx(4.0)


def test_words_are_a_person_s():
    assert words(None) == "unknown yet"
    assert words(14.2) == "about 15 s"
    assert words(600) == "about 10 min"
    assert words(3 * 3600) == "about 3.0 h"
