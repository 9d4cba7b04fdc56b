"""The records of runs: what is written is what everybody reads."""

import threading

import msgspec
import pytest
from bus_setup import Run, some_document, some_metrics, toy_snapshot, wait_until

from taskschema.bus import records as records_module
from taskschema.bus.keys import RUNS, RunKeys
from taskschema.bus.records import FIRST_EVENT, RunRecords
from taskschema.config import RunConfig
from taskschema.errors import BusError, ConfigError, UnknownNameError
from taskschema.policies import PolicySnapshot
from taskschema.schema import SchemaDocument


def test_run_is_registered_once(run: Run) -> None:
    run.records.register_run(run.name, run.config)
    assert run.name in run.records.runs()
    assert run.records.config(run.name) == run.config
    with pytest.raises(BusError, match="another config"):
        run.records.register_run(run.name, RunConfig(task="toy", seed=1))
    assert run.records.config(run.name) == run.config


def test_unknown_run_names_the_known_ones(run: Run) -> None:
    with pytest.raises(UnknownNameError, match=f"Did you mean '{run.name}'"):
        run.records.config(run.name + "x")


@pytest.mark.parametrize("name", ["", "-a", "A", "a b", "a{b}", "a" * 64, "a\n", "a:b"])
def test_names_that_cannot_be_used(name: str) -> None:
    with pytest.raises(ConfigError, match="cannot be used"):
        RunKeys(name)


def test_all_keys_of_a_run_share_a_hash_tag(run: Run) -> None:
    learner = run.learner()
    learner.open_round(0, toy_snapshot(), range(8))
    run.worker()
    keys = RunKeys("toy-schema-seed0.b").all
    assert len(set(keys)) == len(keys)
    assert all(key.startswith("taskschema:{toy-schema-seed0.b}:") for key in keys)
    found = {key.decode() for key in run.client.scan_iter(f"*{run.name}*")}
    assert found <= set(run.keys.all)


def test_deleted_run_leaves_nothing(run: Run) -> None:
    learner = run.learner()
    learner.open_round(0, toy_snapshot(), range(8))
    learner.publish_update(toy_snapshot(1), some_document(run.name, 1), some_metrics(0))
    run.records.delete_run(run.name)
    assert list(run.client.scan_iter(f"*{run.name}*")) == []
    assert not run.client.sismember(RUNS, run.name)


def test_schema_by_version(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(records_module, "KEEP_SCHEMAS", 3)
    assert run.records.schema(run.name) is None
    for version in range(6):
        run.records.write_schema(some_document(run.name, version))
    assert run.records.schema_versions(run.name) == [3, 4, 5]
    assert run.records.schema(run.name, 2) is None
    for version, expected in ((None, 5), (4, 4)):
        data = run.records.schema(run.name, version)
        assert msgspec.json.decode(data, type=SchemaDocument) == some_document(run.name, expected)


def test_policy(run: Run) -> None:
    assert run.records.policy(run.name) is None
    run.records.write_policy(run.name, toy_snapshot(7))
    version, sha256, data = run.records.policy(run.name)
    assert (version, sha256) == (7, toy_snapshot(7).sha256)
    assert PolicySnapshot.from_bytes(data).sha256 == sha256


def test_update_is_published_as_a_whole(run: Run) -> None:
    learner = run.learner()
    for round_index in range(3):
        version = round_index + 1
        update = toy_snapshot(version), some_document(run.name, version), some_metrics(round_index)
        learner.publish_update(*update)
        learner.publish_update(*update)
    assert run.records.curve(run.name) == [some_metrics(index) for index in range(3)]
    assert run.records.curve(run.name, since=2) == [some_metrics(2)]
    assert run.records.latest(run.name) == some_metrics(2)
    assert run.records.policy(run.name).version == 3
    assert run.records.schema_versions(run.name) == [1, 2, 3]
    assert run.records.status(run.name).version == 3


def test_events_from_any_place(run: Run) -> None:
    assert run.records.events(run.name) == []
    assert run.records.last_event(run.name) == FIRST_EVENT
    for round_index in range(3):
        run.records.write_metrics(run.name, some_metrics(round_index))
    events = run.records.events(run.name)
    assert [row.round for _, row in events] == [0, 1, 2]
    assert run.records.events(run.name, events[1][0]) == events[2:]
    assert run.records.last_event(run.name) == events[2][0]


def test_waiting_for_an_event(run: Run) -> None:
    seen: list[tuple[str, object]] = []
    place = run.records.last_event(run.name)
    waiting = threading.Thread(target=lambda: seen.extend(run.records.events(run.name, place, 10_000)))
    waiting.start()
    wait_until(lambda: any(client["cmd"] == "xread" for client in run.client.client_list()))
    run.records.write_metrics(run.name, some_metrics(0))
    waiting.join()
    assert [row for _, row in seen] == [some_metrics(0)]


def test_status(run: Run) -> None:
    status = run.records.status(run.name)
    assert (status.run, status.state, status.version, status.api) == (run.name, "starting", 0, None)
    assert status.started_at
    run.records.set_api(run.name, "http://127.0.0.1:8420")
    run.records.set_progress(run.name, round_index=4, version=4)
    run.records.set_state(run.name, "failed", "no room")
    status = run.records.status(run.name)
    assert (status.state, status.message, status.round) == ("failed", "no room", 4)
    assert status.api == "http://127.0.0.1:8420"
    run.records.set_api(run.name, None)
    assert run.records.status(run.name).api is None


def test_requests(run: Run) -> None:
    def asked() -> tuple[bool, bool]:
        return run.records.pause_requested(run.name), run.records.stop_requested(run.name)

    assert asked() == (False, False)
    run.records.request(run.name, "pause")
    assert asked() == (True, False)
    run.records.request(run.name, "resume")
    assert asked() == (False, False)
    run.records.request(run.name, "stop")
    assert asked() == (False, True)
    run.records.clear_requests(run.name)
    assert asked() == (False, False)


def test_worker_target(run: Run) -> None:
    assert run.records.worker_target(run.name) is None
    run.records.set_worker_target(run.name, 5)
    assert run.records.worker_target(run.name) == 5
    run.records.set_worker_target(run.name, None)
    assert run.records.worker_target(run.name) is None


def test_runs_do_not_see_each_other(run: Run) -> None:
    with Run(run.url) as other:
        run.records.set_worker_target(run.name, 5)
        assert RunRecords(other.client).worker_target(other.name) is None
