"""How long a training will still take, as far as anybody can tell."""

import math
from collections.abc import Sequence

import numpy as np

from taskschema.metrics import RoundMetrics
from taskschema_learner.runs.progress import Limits

LOOK_BACK = 10
"""Rounds that an estimate is made from."""
LEAST_SUCCESS = 0.05
"""Success below which nothing is known about when it will be enough."""


def seconds_left(rows: Sequence[RoundMetrics], limits: Limits) -> float | None:
    """Return the time left [s] at the present pace, or None while it cannot be told.

    Rounds that are limited can be counted. Success grows about like a logistic function once it grows at
    all, so a straight line through its log odds over the last rounds tells when it is enough; before
    that, when a first success comes is a matter of luck, and this says so.
    """
    if not rows:
        return None
    recent = rows[-LOOK_BACK:]
    pace = float(
        np.mean([row.seconds_collect + row.seconds_update + row.seconds_checkpoint for row in recent])
    )
    left = [
        rounds
        for rounds in (_rounds_to_limit(rows[-1], limits), _rounds_to_success(recent, limits))
        if rounds is not None
    ]
    return pace * min(left) if left else None


def _rounds_to_limit(row: RoundMetrics, limits: Limits) -> float | None:
    return None if limits.rounds is None else max(0.0, limits.rounds - row.policy_version)


def _rounds_to_success(recent: Sequence[RoundMetrics], limits: Limits) -> float | None:
    wanted = limits.until_success
    grown = len(recent) >= 3 and recent[-1].success_last_100 >= LEAST_SUCCESS
    if wanted is None or not 0 < wanted < 1 or not grown:
        return None
    odds = [_log_odds(row.success_last_100) for row in recent]
    slope, start = np.polyfit(np.arange(len(odds)), odds, 1)
    if slope <= 0:
        return None
    return max(1.0, float((_log_odds(wanted) - start) / slope - (len(odds) - 1)))


def _log_odds(success: float) -> float:
    inside = min(max(success, 0.005), 0.995)  # of 100 episodes, half a one at the least
    return math.log(inside / (1 - inside))


def words(seconds: float | None) -> str:
    """Say a time left as a person would."""
    if seconds is None:
        return "unknown yet"
    if seconds < 90:
        return f"about {math.ceil(seconds):d} s"
    if seconds < 90 * 60:
        return f"about {round(seconds / 60):d} min"
    return f"about {seconds / 3600:.1f} h"
