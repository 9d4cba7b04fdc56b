"""Fencing: once a newer learner came, the older one changes nothing, whatever it tries."""

from collections.abc import Callable
from typing import Any

import pytest
from bus_setup import Run, deliver, some_document, some_metrics, toy_snapshot

from taskschema.bus import learner_bus
from taskschema.bus.learner_bus import LearnerBus
from taskschema.config import PROTOCOL_VERSION
from taskschema.errors import BusError, ConfigError, StaleTokenError

WRITES: dict[str, Callable[[LearnerBus, Run], Any]] = {
    "open_round": lambda bus, run: bus.open_round(1, toy_snapshot(1), range(8)),
    "results": lambda bus, run: bus.results(0.1),
    "trim": lambda bus, run: bus.trim(0),
    "set_state": lambda bus, run: bus.set_state("finished"),
    "publish_update": lambda bus, run: bus.publish_update(
        toy_snapshot(1), some_document(run.name, 1), some_metrics(0)
    ),
    "restore_curve": lambda bus, run: bus.restore_curve([some_metrics(0)]),
    "verify_token": lambda bus, run: bus.verify_token(),
}


def contents(run: Run) -> dict[str, bytes | None]:
    return {key: run.client.dump(key) for key in run.keys.all}


@pytest.mark.parametrize("write", WRITES)
def test_older_learner_changes_nothing(run: Run, write: str) -> None:
    older = run.learner()
    older.open_round(0, toy_snapshot(0), range(8))
    deliver(run.worker())
    newer = run.learner()
    assert newer.token == older.token + 1
    run.send(b"junk", b"junk")
    ignored = {run.keys.workers, run.keys.heartbeats}
    before = contents(run)
    with pytest.raises(StaleTokenError, match="Another learner has taken over"):
        WRITES[write](older, run)
    after = contents(run)
    assert {key: value for key, value in after.items() if key not in ignored} == {
        key: value for key, value in before.items() if key not in ignored
    }
    WRITES[write](newer, run)


@pytest.mark.parametrize("write", WRITES)
def test_a_learner_without_a_token_changes_nothing(run: Run, write: str) -> None:
    holder = run.learner()
    holder.open_round(0, toy_snapshot(0), range(8))
    before = contents(run)
    with pytest.raises(StaleTokenError, match="Another learner has taken over"):
        WRITES[write](LearnerBus(run.client, run.name, run.config), run)
    assert contents(run) == before


def test_a_run_speaks_the_protocol_of_the_learner_that_holds_the_token(run: Run) -> None:
    older = run.learner()
    run.client.hset(run.keys.config, "protocol", PROTOCOL_VERSION - 1)
    run.records.register_run(run.name, run.config)
    assert run.client.hget(run.keys.config, "protocol") == b"%d" % (PROTOCOL_VERSION - 1)
    older.open_round(0, toy_snapshot(0), range(8))
    newer = run.learner()
    with pytest.raises(StaleTokenError):
        older.set_state("running")
    newer.open_round(0, toy_snapshot(0), range(8))
    assert deliver(run.worker()) == list(range(8))


def test_worker_notices_that_a_learner_of_another_protocol_came(run: Run) -> None:
    worker = run.worker()
    run.client.hset(run.keys.config, "protocol", 99)
    with pytest.raises(ConfigError, match="protocol 99"):
        worker.lease(1)


def test_token_taken_between_watch_and_exec(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    older = run.learner()
    reads = learner_bus.work_entries

    def taken_over_meanwhile(client: Any, keys: Any) -> Any:
        monkeypatch.setattr(learner_bus, "work_entries", reads)
        items = reads(client, keys)
        run.learner()
        return items

    monkeypatch.setattr(learner_bus, "work_entries", taken_over_meanwhile)
    with pytest.raises(StaleTokenError):
        older.open_round(0, toy_snapshot(0), range(8))
    assert run.open_slots() == []
    assert run.records.policy(run.name) is None


def test_disturbed_transaction_is_repeated(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    learner = run.learner()
    reads = learner_bus.work_entries
    calls = []

    def disturbed(client: Any, keys: Any) -> Any:
        calls.append(1)
        items = reads(client, keys)
        if len(calls) == 1:
            run.client.xadd(keys.work, {"item": "not one"})
        return items

    monkeypatch.setattr(learner_bus, "work_entries", disturbed)
    learner.open_round(0, toy_snapshot(0), range(8))
    assert len(calls) == 2
    assert run.open_slots() == list(range(8))


def test_redis_that_lost_the_run_is_not_mistaken_for_a_newer_learner(run: Run) -> None:
    learner = run.learner()
    run.client.delete(run.keys.fence)
    with pytest.raises(BusError, match="--resume") as caught:
        learner.set_state("running")
    assert not isinstance(caught.value, StaleTokenError)
