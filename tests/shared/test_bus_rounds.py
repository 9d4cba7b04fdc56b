"""Rounds on the bus: exactly the slots of a round come in, each once, whoever runs them."""

import statistics
import threading
import time
from typing import Any

import pytest
from bus_setup import Run, deliver, encoded, gather, some_metrics, some_trajectories, toy_snapshot, wait_until

from taskschema.bus import heartbeat, learner_bus
from taskschema.bus.connection import connect
from taskschema.bus.work_stream import open_count
from taskschema.bus.worker_bus import WorkerBus
from taskschema.errors import BusError, ConfigError, QuarantineLimitError, UnknownNameError
from taskschema.trajectory import encode_slot


def test_one_way_of_a_round(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    for round_index in range(3):
        learner.open_round(round_index, toy_snapshot(round_index), range(8))
        assert learner.missing == list(range(8))
        assert deliver(worker) == list(range(8))
        results = gather(learner, 8)
        expected = {slot: encode_slot(some_trajectories(slot, round_index)) for slot in range(8)}
        assert encoded(results) == expected
        assert {result.worker for result in results} == {"worker"}
        assert learner.missing == []
        learner.trim(round_index)
    assert run.client.xlen(run.keys.trajectories) == 0
    assert run.client.xlen(run.keys.work) == 0
    assert run.client.xpending(run.keys.work, "agents")["pending"] == 0
    assert learner.quarantined == 0


def test_worker_gets_the_policy_that_its_slots_ask_for(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    for round_index in range(2):
        learner.open_round(round_index, toy_snapshot(round_index), range(8))
        leases = worker.lease(1)
        assert worker.policy(leases[0]).sha256 == toy_snapshot(round_index).sha256
        worker.submit([(lease, some_trajectories(lease.item.slot, round_index)) for lease in leases])


def test_delivered_work_stays_until_a_checkpoint_covers_it(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    learner.open_round(0, toy_snapshot(), range(8))
    leases = worker.lease(1)
    worker.submit([(lease, some_trajectories(lease.item.slot)) for lease in leases[:3]])
    assert run.client.xlen(run.keys.work) == 8, "an agent removes nothing"
    assert run.open_slots() == [3, 4, 5, 6, 7]
    assert open_count(run.client, run.keys) == 5
    worker.submit([(lease, some_trajectories(lease.item.slot)) for lease in leases[3:]])
    assert open_count(run.client, run.keys) == 0
    assert len(gather(learner, 8)) == 8
    learner.trim(0)
    assert run.client.xlen(run.keys.work) == 0
    learner.open_round(1, toy_snapshot(1), range(5))
    assert open_count(run.client, run.keys) == 5


def test_open_slots_are_counted_whoever_holds_them(run: Run) -> None:
    learner, first, second = run.learner(), run.worker("first"), run.worker("second")
    learner.open_round(0, toy_snapshot(), range(8))
    leases = first.lease(1)
    assert (len(leases), open_count(run.client, run.keys)) == (4, 8)
    first.submit([(leases[0], some_trajectories(leases[0].item.slot))])
    assert open_count(run.client, run.keys) == 7
    assert len(second.lease(1)) == 4, "ceil(7 open slots / 2 agents)"
    second.leave()
    assert open_count(run.client, run.keys) == 7
    assert run.open_slots() == [1, 2, 3, 4, 5, 6, 7]


def test_what_dead_workers_leave_in_the_group_goes(run: Run) -> None:
    learner, worker = run.learner(), run.worker("living")
    for name in ("gone", "busy"):
        run.client.xgroup_createconsumer(run.keys.work, "agents", name)
    learner.open_round(0, toy_snapshot(), range(8))
    deliver(worker)
    gather(learner, 8)
    learner.open_round(1, toy_snapshot(1), range(8))
    run.client.xreadgroup("agents", "busy", {run.keys.work: ">"}, count=1)
    learner.trim(0)
    consumers = {item["name"] for item in run.client.xinfo_consumers(run.keys.work, "agents")}
    assert consumers == {b"living", b"busy"}, "what still holds a lease keeps it"


def test_policy_reaches_an_idle_worker_without_polling(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    arrived: list[float] = []
    opened: list[float] = []
    ready = threading.Semaphore(0)

    def serve() -> None:
        for _ in range(15):
            ready.release()
            leases = worker.lease(10_000)
            worker.policy(leases[0])
            arrived.append(time.perf_counter())
            worker.submit([(lease, some_trajectories(lease.item.slot, lease.item.round)) for lease in leases])

    thread = threading.Thread(target=serve)
    thread.start()
    for round_index in range(15):
        ready.acquire()
        wait_until(lambda: any(client["cmd"] == "xreadgroup" for client in run.client.client_list()))
        opened.append(time.perf_counter())
        learner.open_round(round_index, toy_snapshot(round_index), range(8))
        gather(learner, 8)
    thread.join()
    latency = statistics.median(end - start for start, end in zip(opened, arrived, strict=True))
    assert latency < 0.05, f"{latency * 1e3:.1f} ms; polling once a second would take hundreds"


def test_reopened_round_offers_only_what_is_missing(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    learner.open_round(0, toy_snapshot(), range(8))
    leases = worker.lease(1)
    worker.submit([(lease, some_trajectories(lease.item.slot)) for lease in leases[:3]])
    successor = run.learner()
    successor.open_round(0, toy_snapshot(), range(8))
    assert successor.missing == [3, 4, 5, 6, 7]
    assert sorted(run.open_slots()) == [3, 4, 5, 6, 7]
    assert run.client.xpending(run.keys.work, "agents")["pending"] == 5, "leases outlive the learner"
    worker.submit([(lease, some_trajectories(lease.item.slot)) for lease in leases[3:]])
    assert sorted(encoded(gather(successor, 8))) == list(range(8))
    assert successor.quarantined == 0


def test_reopened_round_offers_what_dead_workers_had_leased(run: Run) -> None:
    learner, dead = run.learner(), run.worker("dead")
    learner.open_round(0, toy_snapshot(), range(8))
    dead.lease(1)
    dead._heartbeat._stop.set()  # as if it had been killed
    dead._heartbeat._thread.join()
    run.client.zadd(run.keys.heartbeats, {"dead": time.time() - 10})
    run.learner().open_round(0, toy_snapshot(), range(8))
    assert deliver(run.worker("living")) == list(range(8)), "at once, long before the leases expire"


def test_robots_work_is_left_to_it(run: Run) -> None:
    learner = run.learner()
    robot = WorkerBus(connect(run.url), run.name, "robot", kind="robot", lease_seconds=3600)
    robot.join()
    learner.open_round(0, toy_snapshot(), range(8))
    leases = robot.lease(1)
    robot._heartbeat._stop.set()
    robot._heartbeat._thread.join()
    run.client.zadd(run.keys.heartbeats, {"robot": time.time() - 10})
    successor = run.learner()
    successor.open_round(0, toy_snapshot(), range(8))
    assert run.client.xpending(run.keys.work, "agents")["pending"] == 8
    robot.submit([(lease, some_trajectories(lease.item.slot)) for lease in leases])
    assert len(gather(successor, 8)) == 8
    assert run.open_slots() == []
    robot.leave()


def test_round_of_another_policy_withdraws_what_was_offered(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    learner.open_round(0, toy_snapshot(0, seed=1), range(8))
    worker.lease(1)
    learner.open_round(0, toy_snapshot(0, seed=2), range(8))
    assert sorted(run.open_slots()) == list(range(8))
    assert run.client.xpending(run.keys.work, "agents")["pending"] == 0
    assert deliver(worker) == list(range(8))


def test_stale_work_is_not_run(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    learner.open_round(0, toy_snapshot(0), range(8))
    run.records.write_policy(run.name, toy_snapshot(1))
    assert worker.lease(1) == []
    assert run.open_slots() == []


def test_late_results_of_earlier_rounds_are_dropped_silently(run: Run) -> None:
    learner, slow = run.learner(), run.worker("slow")
    learner.open_round(0, toy_snapshot(0), range(8))
    late = [(lease, some_trajectories(lease.item.slot)) for lease in slow.lease(1)]
    slow.submit(list(late))
    gather(learner, 8)
    learner.trim(0)
    learner.open_round(1, toy_snapshot(1), range(8))
    slow.submit(late)
    deliver(slow)
    assert {result.round for result in gather(learner, 8)} == {1}
    assert learner.quarantined == 0
    learner.trim(1)
    assert run.client.xlen(run.keys.trajectories) == 0


def test_trim_after_the_next_round_opened_keeps_its_results(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    learner.open_round(0, toy_snapshot(0), range(8))
    deliver(worker)
    gather(learner, 8)
    learner.open_round(1, toy_snapshot(1), range(8))
    deliver(worker)
    gather(learner, 8)
    learner.trim(0)
    assert run.client.xlen(run.keys.trajectories) == 8
    successor = run.learner()
    successor.open_round(1, toy_snapshot(1), range(8))
    assert successor.missing == []


def test_learner_that_goes_back_ignores_results_of_later_rounds(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    learner.open_round(5, toy_snapshot(5), range(8))
    deliver(worker)
    successor = run.learner()
    successor.open_round(4, toy_snapshot(4), range(8))
    assert successor.missing == list(range(8))
    assert successor.quarantined == 0


def test_expired_lease_is_claimed_by_another(run: Run) -> None:
    learner, dead = run.learner(), run.worker("dead")
    learner.open_round(0, toy_snapshot(), range(8))
    assert len(dead.lease(1)) == 8
    dead._heartbeat._stop.set()  # as if it had been killed
    dead._heartbeat._thread.join()
    other = run.worker("other", lease_seconds=0.3)
    slots: list[int] = []
    wait_until(lambda: bool(slots.extend(deliver(other, block_ms=100)) or len(slots) == 8))
    assert sorted(encoded(gather(learner, 8))) == list(range(8))


def test_lease_of_a_busy_worker_is_renewed(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heartbeat, "INTERVAL_SECONDS", 0.05)
    learner, busy = run.learner(), run.worker("busy")
    learner.open_round(0, toy_snapshot(), range(8))
    leases = busy.lease(1)
    assert len(leases) == 8
    other = run.worker("other", lease_seconds=1.0)
    deadline = time.monotonic() + 2.5
    while time.monotonic() < deadline:
        assert other.lease(100) == []


def test_an_agent_that_was_killed_takes_up_again_what_it_had_leased(run: Run) -> None:
    learner = run.learner()
    learner.open_round(0, toy_snapshot(), range(8))
    killed, again = (
        WorkerBus(connect(run.url), run.name, "robot", kind="robot", lease_seconds=6 * 3600) for _ in range(2)
    )
    killed.join()
    assert len(killed.lease(1)) == 8
    killed._heartbeat._stop.set()  # as if it had been killed
    killed._heartbeat._thread.join()
    with again:
        assert deliver(again) == list(range(8)), "at once, long before the leases expire"
    assert len(gather(learner, 8)) == 8


def test_leaving_worker_hands_its_leases_back(run: Run) -> None:
    learner = run.learner()
    learner.open_round(0, toy_snapshot(), range(8))
    with WorkerBus(connect(run.url), run.name, "leaving") as leaving:
        assert len(leaving.lease(1)) == 8
    assert run.records.workers(run.name) == []
    assert deliver(run.worker("staying")) == list(range(8))
    assert len(gather(learner, 8)) == 8


def test_lost_slots_are_offered_again(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskschema.bus.learner_bus.QUIET_SECONDS", 0.1)
    learner, worker = run.learner(), run.worker()
    learner.open_round(0, toy_snapshot(), range(8))
    run.client.xtrim(run.keys.work, 5)  # slots 0 to 2 are gone
    learner.results(0.3)
    assert sorted(deliver(worker)) == list(range(8))
    assert len(gather(learner, 8)) == 8


def test_result_that_arrives_while_the_learner_looks_for_lost_slots(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learner_bus, "QUIET_SECONDS", 0.05)
    learner, worker = run.learner(), run.worker()
    learner.open_round(0, toy_snapshot(), range(8))
    look = learner_bus.work_entries
    arrivals: list[int] = []

    def arriving_meanwhile(client: Any, keys: Any) -> Any:
        arrivals.extend(deliver(worker))
        return look(client, keys)

    monkeypatch.setattr(learner_bus, "work_entries", arriving_meanwhile)
    assert len(gather(learner, 8)) == 8
    assert arrivals == list(range(8))
    assert run.open_slots() == []
    assert run.client.hlen(run.keys.refusals) == 0
    assert learner.quarantined == 0


def test_slot_that_is_lost_again_and_again_stops_the_run(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskschema.bus.learner_bus.QUIET_SECONDS", 0.05)
    learner = run.learner()
    learner.open_round(0, toy_snapshot(), [4])
    for _ in range(2):
        run.client.xtrim(run.keys.work, 0)
        learner.results(0.1)
    run.client.xtrim(run.keys.work, 0)
    with pytest.raises(QuarantineLimitError, match="Slot 4 of round 0"):
        learner.results(0.1)


def test_worker_refuses_what_it_cannot_serve(run: Run) -> None:
    client = connect(run.url)
    with pytest.raises(UnknownNameError, match="no-such-run"):
        WorkerBus(client, "no-such-run", "w").join()
    run.worker("simulated")
    with pytest.raises(ConfigError, match="served by simulation agents"):
        WorkerBus(client, run.name, "w", kind="robot").join()
    run.client.hset(run.keys.config, "protocol", 99)
    with pytest.raises(ConfigError, match="protocol 99"):
        WorkerBus(client, run.name, "w").join()


def test_worker_notices_that_its_run_was_replaced(run: Run) -> None:
    worker = run.worker()
    run.client.hset(run.keys.config, "hash", "0" * 64)
    with pytest.raises(ConfigError, match="another config now"):
        worker.lease(1)


def test_worker_must_join_first(run: Run) -> None:
    worker = run.worker()
    worker.leave()
    with pytest.raises(BusError, match="join it first"):
        worker._beating  # noqa: B018


def test_workers_tell_what_they_do(run: Run) -> None:
    learner, worker = run.learner(), run.worker("talkative")
    learner.open_round(0, toy_snapshot(), range(8))
    leases = worker.lease(1)
    wait_until(lambda: run.records.workers(run.name)[0].busy_slots == 8)
    worker.submit([(lease, some_trajectories(lease.item.slot)) for lease in leases])
    wait_until(lambda: run.records.workers(run.name)[0].episodes == 32)
    (info,) = run.records.workers(run.name)
    assert (info.id, info.kind, info.busy_slots) == ("talkative", "simulation", 0)
    assert info.episodes_per_second > 0
    assert 0 <= info.last_seen < 5


def test_dead_workers_are_forgotten(run: Run) -> None:
    learner = run.learner()
    run.client.zadd(run.keys.heartbeats, {"old": time.time() - 100})
    run.client.hset(run.keys.workers, "old", b"{}")
    assert run.records.workers(run.name) == []
    learner.trim(0)
    assert run.client.zcard(run.keys.heartbeats) == 0
    assert run.client.hlen(run.keys.workers) == 0


def test_curve_of_the_folder_fills_what_redis_lacks(run: Run) -> None:
    learner = run.learner()
    run.records.write_metrics(run.name, some_metrics(0))
    learner.restore_curve([some_metrics(index) for index in range(4)])
    learner.restore_curve([some_metrics(index) for index in range(4)])
    assert [row.round for row in run.records.curve(run.name)] == [0, 1, 2, 3]
