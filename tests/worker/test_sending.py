"""Frames travel while the next ones are made, and arrive once, whatever fails on the way."""

import threading

import numpy as np
import pytest
from bus_setup import Run, encoded, gather
from spatial_setup import TOY, image_config, some_weights

from taskschema.bus.connection import connect
from taskschema.bus.lease import Lease
from taskschema.bus.worker_bus import WorkerBus
from taskschema.errors import BusError
from taskschema.policies import ImagePolicy, PolicySnapshot
from taskschema.trajectory import Trajectory, encode_slot
from taskschema_worker.environments import make_environment
from taskschema_worker.rollout import collect_slots
from taskschema_worker.worker import SEEN_SLOTS, Worker

PARTS = 3
SLOTS = (PARTS - 1) * SEEN_SLOTS + 1
SNAPSHOT = PolicySnapshot(0, some_weights(), np.zeros((TOY.horizon, len(TOY.pairs))))


@pytest.fixture
def run(shared_redis):
    with Run(shared_redis.url, image_config(slots=SLOTS, episodes_per_slot=2)) as fresh:
        yield fresh


@pytest.fixture(scope="module")
def expected() -> dict[int, bytes]:
    """What all slots come to when they are run as one batch."""
    slots = collect_slots(
        make_environment(TOY, observation="image"),
        ImagePolicy(SNAPSHOT, TOY, "small"),
        seed=0,
        round_index=0,
        slots=range(SLOTS),
        episodes_per_slot=2,
        horizon=3,
    )
    return {slot: encode_slot(trajectories) for slot, trajectories in enumerate(slots)}


class WatchfulBus(WorkerBus):
    """Lets no part but the last go before the next one has begun; notes how large they are."""

    def watch(self, worker: Worker) -> None:
        self.next_began, self.sizes, begun = threading.Semaphore(0), [], []
        environment = worker._environment
        reset = environment.reset

        def noticed(generators):
            if begun:
                self.next_began.release()
            begun.append(len(generators))
            return reset(generators)

        environment.reset = noticed

    def submit(self, results: list[tuple[Lease, list[Trajectory]]]) -> None:
        if results:
            self.sizes.append(len(results))
            assert len(self.sizes) == PARTS or self.next_began.acquire(timeout=30)
        super().submit(results)


def test_a_part_travels_while_the_next_one_is_made(run, expected):
    learner = run.learner()
    bus = WatchfulBus(connect(run.url), run.name, "worker")
    worker = Worker(bus)
    bus.watch(worker)
    learner.open_round(0, SNAPSHOT, range(SLOTS))
    assert worker.run_once(1) == SLOTS
    assert bus.sizes == [SEEN_SLOTS, SEEN_SLOTS, 1]
    assert encoded(gather(learner, SLOTS)) == expected
    assert run.open_slots() == []
    worker.close()


@pytest.mark.parametrize("failures", [1, 2, 3])
def test_what_could_not_be_sent_is_sent_later_and_once(run, expected, monkeypatch, failures):
    learner = run.learner()
    bus = WorkerBus(connect(run.url), run.name, "worker")
    worker = Worker(bus)
    submit, left = bus.submit, failures

    def failing(results):
        nonlocal left
        if results and left:
            left -= 1
            raise BusError("Redis does not answer.")
        submit(results)

    monkeypatch.setattr(bus, "submit", failing)
    learner.open_round(0, SNAPSHOT, range(SLOTS))
    if failures == 3:  # the last part's turn, which the caller hears of
        with pytest.raises(BusError):
            worker.run_once(1)
        assert worker.run_once(1) == 0
    else:
        assert worker.run_once(1) == SLOTS
    assert left == 0
    assert encoded(gather(learner, SLOTS)) == expected
    assert learner.quarantined == 0
    assert run.open_slots() == []
    worker.close()
