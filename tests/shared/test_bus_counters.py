"""What is counted for monitoring: it grows with the work, once for each, and outlives who did it."""

import time

import msgspec
import pytest
from bus_setup import Run, deliver, gather, some_document, some_metrics, toy_snapshot, wait_until

from taskschema.bus.counters import BOUNDS, Histogram, RunCounters
from taskschema.bus.learner_bus import FORGET_WORKERS_SECONDS


def test_a_histogram_puts_a_time_where_it_belongs() -> None:
    histogram = Histogram()
    for seconds in (0.005, 0.006, 300.0, 301.0):
        histogram = histogram.added(seconds)
    expected = [0] * (len(BOUNDS) + 1)
    expected[0] = 1  # up to 5 ms
    expected[1] = 1  # up to 10 ms
    expected[-2] = 1  # up to 300 s
    expected[-1] = 1  # longer
    assert list(histogram.counts) == expected
    assert histogram.total == pytest.approx(601.011)


def test_rounds_are_counted_once_and_again_in_a_redis_that_lost_them(run: Run) -> None:
    learner = run.learner()
    rows = [
        msgspec.structs.replace(some_metrics(index), physics_steps=100 * (index + 1)) for index in range(3)
    ]
    for index, row in enumerate(rows):
        learner.publish_update(toy_snapshot(index + 1), some_document(run.name, index + 1), row)
    learner.restore_curve(rows)
    counted = run.records.counters(run.name)
    assert counted.physics_steps == 100 + 200 + 300
    assert (counted.diverged, counted.refused) == (3, 3)
    assert counted.phases["collect"].total == pytest.approx(1.5)
    assert sum(counted.phases["publish"].counts) == 3
    of_rows = RunCounters.of_rows(rows)
    assert (counted.phases, counted.physics_steps) == (of_rows.phases, of_rows.physics_steps)
    run.client.delete(run.keys.curve, run.keys.counters)
    learner.restore_curve(rows)
    assert run.records.counters(run.name) == counted


def test_leases_of_all_workers_are_counted_together(run: Run) -> None:
    learner, first = run.learner(), run.worker("first")
    learner.open_round(0, toy_snapshot(), range(8))
    deliver(first)
    gather(learner, 8)
    learner.open_round(1, toy_snapshot(1), range(8))
    first.lease(1)
    first.leave()
    deliver(run.worker("second"))
    counted = run.records.counters(run.name)
    assert sum(counted.leases.counts) == 16, "what was handed back was delivered once"
    assert 0 < counted.leases.total < 60
    assert (counted.workers_joined, counted.workers_lost, counted.leases_taken_over) == (2, 0, 8)
    assert counted.learner_starts == 1


def test_a_worker_that_falls_silent_is_lost_once(run: Run) -> None:
    learner = run.learner()
    run.client.zadd(run.keys.heartbeats, {"silent": time.time() - FORGET_WORKERS_SECONDS - 1})
    run.worker("alive").leave()
    for _ in range(2):
        learner.trim(0)
    assert run.records.counters(run.name).workers_lost == 1


def test_a_learner_that_comes_again_is_counted(run: Run) -> None:
    run.learner()
    run.learner()
    wait_until(lambda: run.records.counters(run.name).learner_starts == 2)
