"""Workers on a real Redis: whoever runs a slot, and whatever dies, its trajectories are the same."""

import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from bus_setup import Run, encoded, gather, some_trajectories, toy_snapshot, wait_until

from taskschema.bus.admission import SlotResult
from taskschema.bus.connection import connect
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import RunConfig
from taskschema.errors import BusError, ConfigError
from taskschema.policies import Policy
from taskschema.tasks.toy import Toy
from taskschema.trajectory import encode_slot
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_worker.rollout import collect_slots
from taskschema_worker.worker import Worker

HELD_TASK = """
import time
from pathlib import Path
from taskschema.tasks.toy import Toy, ToyEnvironment

class HeldEnvironment(ToyEnvironment):
    def step(self, episodes, pairs, arguments):
        while Path({gate!r}).exists():
            time.sleep(0.01)
        return super().step(episodes, pairs, arguments)

class Held(Toy):
    def make_environment(self, threads=1):
        return HeldEnvironment(self)
"""


def expected(round_index: int, slots: int = 8) -> dict[int, bytes]:
    """What one undisturbed process makes of a round."""
    task = Toy()
    collected = collect_slots(
        task.make_environment(),
        Policy(toy_snapshot(round_index), task.pairs, task.observation),
        seed=0,
        round_index=round_index,
        slots=range(slots),
        episodes_per_slot=4,
        horizon=3,
    )
    return {slot: encode_slot(trajectories) for slot, trajectories in enumerate(collected)}


@contextmanager
def working(run: Run, count: int) -> Iterator[None]:
    """Workers in threads of this process."""
    stop = threading.Event()
    workers = [Worker(WorkerBus(connect(run.url), run.name, f"worker-{index}")) for index in range(count)]
    threads = [threading.Thread(target=worker.run, args=[stop]) for worker in workers]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        for thread in threads:
            thread.join()


def start_process(run: Run, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "taskschema_worker", "--run", run.name, *options],
        env={**os.environ, "TASKSCHEMA_REDIS_URL": run.url},
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("count", [1, 3])
def test_rounds_are_the_same_with_any_number_of_workers(run: Run, count: int) -> None:
    learner = run.learner()
    with working(run, count):
        for round_index in range(3):
            learner.open_round(round_index, toy_snapshot(round_index), range(8))
            assert encoded(gather(learner, 8)) == expected(round_index)
            learner.trim(round_index)
    assert learner.quarantined == 0
    assert run.records.workers(run.name) == []


def test_worker_inside_the_learners_process(run: Run) -> None:
    learner = run.learner()
    worker = Worker(WorkerBus(connect(run.url), run.name, "inline"))
    assert worker.run_once(1) == 0
    learner.open_round(0, toy_snapshot(), range(8))
    assert worker.run_once(1) == 8
    assert encoded(gather(learner, 8)) == expected(0)
    worker.close()
    worker.close()


def test_killed_worker_loses_nothing_but_time(shared_redis: EmbeddedRedis, tmp_path: Path) -> None:
    gate = tmp_path / "gate"
    gate.touch()
    config = RunConfig(task="Held", task_source=HELD_TASK.format(gate=str(gate)), slots=8)
    with Run(shared_redis.url, config) as run:
        learner = run.learner()
        learner.open_round(0, toy_snapshot(), range(8))
        process = start_process(run)
        wait_until(lambda: run.client.xpending(run.keys.work, "agents")["pending"] == 8)
        process.kill()
        process.communicate()
        gate.unlink()
        survivor = Worker(WorkerBus(connect(run.url), run.name, "survivor", lease_seconds=1.5))
        results: list[SlotResult] = []
        wait_until(lambda: survivor.run_once(100) > 0)
        while len(results) < 8:
            survivor.run_once(100)
            results += learner.results(0.1)
        assert encoded(results) == expected(0)
        assert {result.worker for result in results} == {"survivor"}
        survivor.close()


def test_killed_redis_is_waited_for(tmp_path: Path) -> None:
    with EmbeddedRedis(tmp_path) as server, Run(server.url) as run, working(run, 2):
        learner = run.learner()
        for round_index in range(6):
            learner.open_round(round_index, toy_snapshot(round_index), range(8))
            if round_index in (1, 3):
                before = server.pid
                os.kill(before, signal.SIGKILL)
                wait_until(lambda before=before: server.pid != before)
            assert encoded(gather(learner, 8)) == expected(round_index)


def test_run_goes_on_when_everything_starts_again(tmp_path: Path) -> None:
    with EmbeddedRedis(tmp_path) as server:
        run = Run(server.url)
        run.records.register_run(run.name, run.config)
        run.learner().open_round(0, toy_snapshot(), range(8))
        worker = run.worker()
        leases = worker.lease(1)
        delivered = {slot: data for slot, data in expected(0).items() if slot < 3}
        for lease in leases[:3]:
            run.send(run.header(lease.item.slot, toy_snapshot()), delivered[lease.item.slot])
        os.kill(server.pid, signal.SIGKILL)
    with EmbeddedRedis(tmp_path) as server:
        again = Run(server.url)
        again.name, again.keys = run.name, run.keys
        again.records.register_run(again.name, again.config)
        learner = again.learner()
        learner.open_round(0, toy_snapshot(), range(8))
        assert learner.missing == [3, 4, 5, 6, 7]
        claimer = Worker(WorkerBus(connect(server.url), again.name, "claimer", lease_seconds=0.1))
        results: list[SlotResult] = []
        while len(results) < 8:
            claimer.run_once(200)
            results += learner.results(0.1)
        assert encoded(results) == expected(0)
        claimer.close()


def test_undelivered_slots_are_delivered_when_redis_is_back(
    run: Run, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    learner = run.learner()
    bus = WorkerBus(connect(run.url), run.name, "worker")
    worker = Worker(bus)
    learner.open_round(0, toy_snapshot(), range(8))
    submit = bus.submit
    failures = iter([False, True, True])

    def failing(results):
        if next(failures, False):
            raise BusError("Redis does not answer.")
        submit(results)

    monkeypatch.setattr(bus, "submit", failing)
    monkeypatch.setattr("taskschema_worker.worker.RETRY_SECONDS", 0.01)
    stop = threading.Event()
    with caplog.at_level(logging.WARNING, "taskschema.worker"):
        thread = threading.Thread(target=worker.run, args=[stop])
        thread.start()
        results = gather(learner, 8)
        stop.set()
        thread.join()
    assert encoded(results) == expected(0)
    assert caplog.text.count("Trying again") == 2
    assert learner.quarantined == 0, "nothing was delivered twice"


def test_process_ends_cleanly_on_sigterm(run: Run) -> None:
    learner = run.learner()
    learner.open_round(0, toy_snapshot(), range(8))
    process = start_process(run)
    assert encoded(gather(learner, 8)) == expected(0)
    process.terminate()
    _, log = process.communicate(timeout=10)
    assert process.returncode == 0, log
    assert "taskschema.worker" in log
    assert run.records.workers(run.name) == []


def test_process_says_in_one_line_what_is_missing(run: Run) -> None:
    process = start_process(Run(run.url), "--wait", "0")
    _, log = process.communicate(timeout=30)
    assert process.returncode == 1
    assert log.startswith("taskschema_worker: Unknown run 'test-")
    assert log.count("\n") == 1


def test_process_waits_for_its_run(shared_redis: EmbeddedRedis) -> None:
    run = Run(shared_redis.url)
    process = start_process(run)
    assert process.stderr is not None
    assert "Waiting up to 60 s" in process.stderr.readline()
    with run:
        wait_until(lambda: len(run.records.workers(run.name)) == 1)
        process.terminate()
        process.communicate(timeout=10)
        assert process.returncode == 0


def test_worker_stops_when_its_run_is_replaced(run: Run) -> None:
    worker = Worker(WorkerBus(connect(run.url), run.name, "worker"))
    run.client.hset(run.keys.config, "hash", "0" * 64)
    with pytest.raises(ConfigError, match="another config now"):
        worker.run(threading.Event())


def test_made_up_trajectories_are_told_apart_from_real_ones() -> None:
    """Guards the tests above: the expectation is no constant."""
    assert expected(0) != expected(1)
    assert expected(0)[0] != encode_slot(some_trajectories(0))
