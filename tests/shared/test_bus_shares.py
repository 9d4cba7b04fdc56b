"""How the agents of a run share the slots of a round."""

import threading
import time

from bus_setup import Run, deliver, toy_snapshot, wait_until

from taskschema.bus.worker_bus import MOST_SHARED_SLOTS, MOST_SLOTS, WorkerBus


def test_two_workers_share_a_round(run: Run) -> None:
    learner, first, second = run.learner(), run.worker("first"), run.worker("second")
    learner.open_round(0, toy_snapshot(), range(8))
    assert [len(first.lease(1)), len(second.lease(1))] == [4, 4]


def test_workers_that_share_cores_lease_as_many_slots_as_there_are_cores_for(run: Run) -> None:
    learner, workers = run.learner(), [run.worker(f"worker-{index}", cores=0.25) for index in range(8)]
    learner.open_round(0, toy_snapshot(), range(12))
    assert [len(worker.lease(1)) for worker in workers[:3]] == [6, 6, 0]
    learner.open_round(1, toy_snapshot(), range(100))
    assert len(workers[3].lease(1)) == MOST_SHARED_SLOTS


def test_a_lone_worker_leases_a_large_round_in_parts(run: Run) -> None:
    learner, worker = run.learner(), run.worker()
    learner.open_round(0, toy_snapshot(), range(MOST_SLOTS + 5))
    assert [len(deliver(worker)), len(deliver(worker))] == [MOST_SLOTS, 5]


def test_an_idle_worker_asks_often_for_leases_that_others_hold(
    run: Run,
) -> None:
    learner, busy, idle = run.learner(), run.worker("busy", lease_seconds=0.5), run.worker("idle", 0.5)
    learner.open_round(0, toy_snapshot(), range(2))
    assert len(busy.lease(1) + busy.lease(1)) == 2
    started = time.monotonic()
    idle.lease(10_000)
    assert time.monotonic() - started < 5.0


def test_idle_workers_share_a_round_that_opens(run: Run) -> None:
    learner = run.learner()
    shares: dict[str, int] = {}

    def wait(worker: WorkerBus) -> None:
        shares[worker.worker_id] = len(worker.lease(5_000))

    threads = [
        threading.Thread(target=wait, args=[worker]) for worker in [run.worker("first"), run.worker("second")]
    ]
    for thread in threads:
        thread.start()
    blocked = ["xreadgroup"] * 2
    wait_until(lambda: [c["cmd"] for c in run.client.client_list() if c["cmd"] == "xreadgroup"] == blocked)
    learner.open_round(0, toy_snapshot(), range(8))
    for thread in threads:
        thread.join()
    assert shares == {"first": 4, "second": 4}
