"""The worker pool on a real, local Ray, with a real Redis and the toy task."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest
from processes import command_line

from taskschema.bus.connection import connect
from taskschema.bus.learner_bus import LearnerBus
from taskschema.bus.records import RunRecords
from taskschema.config import RunConfig
from taskschema.tasks.registry import task_of
from taskschema_learner.embedded_redis import EmbeddedRedis
from taskschema_learner.learner import Learner
from taskschema_learner.workers.ray_runtime import Node
from taskschema_learner.workers.worker_pool import ACTORS_PER_CORE, WorkerPool, places, share_of_core

RUN = "pool-test"
CONFIG = RunConfig(task="toy", slots=6, episodes_per_slot=2)


def wait_until(condition, seconds=60.0):
    """Poll a condition that another process brings about; fail if it never comes true."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not come true in time"
        threading.Event().wait(0.05)


def child_processes(others=frozenset()):
    """Return Ray's processes below this one: not Redis, and not what other tests' fixtures still run."""
    return [
        child
        for child in psutil.Process().children(recursive=True)
        if command_line(child) and "redis" not in child.name() and child not in others
    ]


def actor_processes():
    return [child for child in child_processes() if "RolloutActor" in command_line(child)]


@pytest.fixture(scope="module")
def redis(tmp_path_factory):
    with EmbeddedRedis(tmp_path_factory.mktemp("redis")) as server:
        yield server


@pytest.fixture(scope="module")
def records(redis):
    records = RunRecords(connect(redis.url))
    records.register_run(RUN, CONFIG)
    return records


@pytest.fixture(scope="module")
def others(redis):
    """What ran below this process before the pool did."""
    return frozenset(child_processes())


@pytest.fixture(scope="module")
def pool(redis, records, others):
    with WorkerPool(redis.url, RUN, target=2) as pool:
        wait_until(lambda: len(records.workers(RUN)) == 2)
        yield pool


def test_actors_are_placed_and_know_nothing_of_torch(pool):
    assert pool.size == 2
    sizes = pool.memory()
    assert len(sizes) == 2
    assert max(sizes) < 120e6  # own memory; torch alone would be more
    for process in actor_processes():
        assert not any("libtorch" in mapped.path for mapped in process.memory_maps())
        environment = process.environ()
        assert {environment[f"{name}_NUM_THREADS"] for name in ("OMP", "OPENBLAS", "MKL")} == {"1"}


def test_what_actors_run_yields_to_learner_redis_and_api(pool):
    own = psutil.Process().nice()
    for process in actor_processes():
        names = {item.id: Path(f"/proc/{process.pid}/task/{item.id}/comm") for item in process.threads()}
        running = [number for number, name in names.items() if name.read_text().startswith("ray::Rollout")]
        assert running
        assert min(os.getpriority(os.PRIO_PROCESS, number) for number in running) > own


def test_ray_listens_on_loopback_alone(pool):
    for process in child_processes():
        for connection in process.net_connections(kind="tcp"):
            if connection.status == psutil.CONN_LISTEN:
                assert connection.laddr.ip.removeprefix("::ffff:") == "127.0.0.1", process.cmdline()


def test_the_password_is_in_no_process_list_and_no_log_of_ray(pool, redis):
    password = redis.url.split(":")[2].split("@")[0]
    for process in child_processes():
        assert password not in " ".join(process.cmdline())
        assert password not in str(process.environ())
    files = [path for path in pool._ray._folder.rglob("*") if path.is_file()]
    assert files
    for path in files:
        assert password.encode() not in path.read_bytes(), path


def collect(redis, rounds, act=lambda number: None):
    """Run some rounds as a learner does and return the policies' hashes."""
    learner = Learner(CONFIG, task_of(CONFIG))
    bus = LearnerBus(connect(redis.url), RUN, CONFIG)
    bus.acquire()
    hashes = []
    for number in range(rounds):
        bus.open_round(number, learner.snapshot(), range(CONFIG.slots))
        act(number)
        results = {}
        deadline = time.monotonic() + 90
        while len(results) < CONFIG.slots:
            assert time.monotonic() < deadline, "the round does not end"
            for result in bus.results(timeout=0.25):
                results[result.slot] = result.trajectories
        learner.update([item for slot in sorted(results) for item in results[slot]])
        hashes.append(learner.snapshot().sha256)
        bus.trim(number)
    return hashes


def test_rounds_are_the_same_while_workers_are_killed_added_and_removed(pool, redis, records):
    from taskschema_learner.runs.recomputation import recompute

    def disturb(number):
        if number == 1:
            os.kill(actor_processes()[0].pid, signal.SIGKILL)
        elif number == 2:
            records.set_worker_target(RUN, 4)
            wait_until(lambda: len(records.workers(RUN)) >= 4)
        elif number == 3:
            records.set_worker_target(RUN, 1)

    hashes = collect(redis, 5, disturb)
    assert hashes == [each.sha256 for each in recompute(CONFIG, 5)]
    wait_until(lambda: len(actor_processes()) == 1)


def test_a_dead_actor_comes_back(pool, records):
    records.set_worker_target(RUN, 2)
    wait_until(lambda: pool.size == 2 and len(records.workers(RUN)) == 2)
    before = {info.pid for info in records.workers(RUN)}
    victim = before.pop()
    os.kill(victim, signal.SIGKILL)
    wait_until(lambda: len({info.pid for info in records.workers(RUN)} - {victim}) == 2)


GIB = float(2**30)


def test_a_share_fits_on_nodes_and_not_only_on_their_sum():
    three = [Node(1.0, GIB)] * 3
    assert [share_of_core(three, actors) for actors in (1, 3)] == [1.0, 1.0]
    # 3 cores / 4 actors = 0.75, of which one fits on each node: three. Halves: two on each, six.
    assert share_of_core(three, 4) == 0.5
    assert share_of_core(three, 7) == 0.3333
    # 1.5 cores hold one whole actor, or three halves.
    assert [places([Node(1.5, GIB)], per_core) for per_core in (1, 2)] == [1, 3]


def test_memory_and_cores_bound_how_many_fit():
    assert places([Node(1.0, GIB)], ACTORS_PER_CORE) == 6  # 1024 MiB / 150 MiB
    assert places([Node(1.0, GIB), Node(0.0, 8 * GIB)], ACTORS_PER_CORE) == 6  # no cores, no actors
    assert places([Node(1.0, 100 * GIB)], ACTORS_PER_CORE) == 64
    assert places([], ACTORS_PER_CORE) == 0


def test_actors_outnumber_cores_by_fractions_of_one(pool):
    cores = len(os.sched_getaffinity(0))
    assert pool.capacity >= 50
    shares = {actor.share for actor in pool._actors if actor.retired_at is None}
    assert all(share <= 1 for share in shares)
    assert sum(actor.share for actor in pool._actors if actor.retired_at is None) <= cores


def test_closing_leaves_no_process_behind_and_is_quick(pool, records, others):
    """Last in this module: it closes the pool that the tests before share."""
    processes = child_processes(others)
    assert processes
    folder = pool._ray._folder
    started = time.monotonic()
    pool.close()
    assert time.monotonic() - started < 5
    psutil.wait_procs(processes, timeout=2)
    assert [process for process in processes if process.is_running()] == []
    assert not folder.exists()


def test_nothing_outlives_a_killed_learner(redis, records):
    script = (
        "import sys, time\n"
        "from taskschema_learner.workers.worker_pool import WorkerPool\n"
        f"with WorkerPool(sys.stdin.readline().strip(), {RUN!r}, target=1) as pool:\n"
        "    print(pool._ray._folder, flush=True)\n"
        "    time.sleep(300)\n"
    )
    learner = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    learner.stdin.write(redis.url + "\n")
    learner.stdin.flush()
    folder = Path(learner.stdout.readline().strip())
    assert folder.is_dir()
    wait_until(lambda: len(actor_processes()) == 1)
    processes = psutil.Process(learner.pid).children(recursive=True)
    learner.kill()
    learner.wait()
    _, alive = psutil.wait_procs(processes, timeout=10)
    assert alive == []
    wait_until(lambda: not folder.exists())


def test_a_cluster_that_is_not_there_is_one_clear_error(redis):
    # In a process of its own, because one process connects to one Ray.
    script = (
        "import sys\n"
        "from taskschema.errors import RayError\n"
        "from taskschema_learner.workers.ray_runtime import RayRuntime\n"
        "try: RayRuntime('127.0.0.1:1').start()\n"
        "except RayError as error: print(error)\n"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert "127.0.0.1:1 cannot be reached" in result.stdout
    assert result.stdout.count("\n") == 1
