"""Trainings submitted to a cluster of several nodes, with the very commands that docs/cluster.md shows."""

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from ray_cluster import NODE, ROOT, RayCluster

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema_learner.embedded_redis import EmbeddedRedis

PACKAGES = {"taskschema", "taskschema_worker", "taskschema_learner"}


@pytest.fixture(scope="module")
def redis(tmp_path_factory):
    with EmbeddedRedis(tmp_path_factory.mktemp("redis")) as server:
        yield server


@pytest.fixture(scope="module")
def cluster(redis):
    # A short path: Ray's sockets lie in it.
    folder = tempfile.TemporaryDirectory(prefix="ray-")
    with folder as path, RayCluster(Path(path), redis.url).running(workers=2) as cluster:
        yield cluster


def documented(beginning: str) -> list[str]:
    """Return the words of the command in the docs that begins so."""
    text = (ROOT / "docs/cluster.md").read_text()
    match = re.search(rf"^({beginning} (?:.*\\\n)*.*)$", text, flags=re.MULTILINE)
    assert match is not None, f"docs/cluster.md shows no {beginning!r}"
    return match[1].replace("\\\n", " ").split()[1:]


def submission(folder: Path, *further: str) -> list[str]:
    """Return the documented submission, of the toy task."""
    words = documented("ray job submit")
    words[words.index("train") + 1] = "toy"
    words[words.index("--run-dir") + 1] = str(folder)
    return [*words, *further]


def taskschema(*words: str) -> str:
    command = [sys.executable, "-m", "taskschema_learner", *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def embedded_hash(folder: Path, rounds: int) -> str:
    options = ["--workers", "0", "--api", "none", "--until-success", "0", "--rounds", str(rounds)]
    taskschema("train", "toy", "--run-dir", str(folder), *options)
    return taskschema("hash", str(folder))


def test_a_training_is_submitted_and_brings_only_the_packages(cluster, redis, tmp_path):
    done = cluster.ray(*submission(tmp_path / "job", "--rounds", "2", "--until-success", "0"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 rounds are done" in done.stdout
    assert redis.url not in done.stdout + done.stderr
    uploaded = list(cluster.folder.glob("session_2*/runtime_resources/py_modules_files/_ray_pkg_*/*"))
    assert {path.name for path in uploaded} == PACKAGES
    assert not [path for path in cluster.folder.rglob("__pycache__/*") if "_ray_pkg" in str(path.parents[2])]
    assert taskschema("hash", str(tmp_path / "job")) == embedded_hash(tmp_path / "here", 2)


def test_who_lacks_the_token_gets_nowhere(cluster):
    cluster.environment["RAY_AUTH_TOKEN"], right = "0" * 64, cluster.environment["RAY_AUTH_TOKEN"]
    try:
        refused = cluster.ray("job", "list")
    finally:
        cluster.environment["RAY_AUTH_TOKEN"] = right
    assert refused.returncode != 0
    assert "401" in refused.stderr or "403" in refused.stderr or "token" in refused.stderr.lower()


def test_a_node_without_a_token_does_not_start():
    refused = subprocess.run([NODE, "head"], env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True)
    assert refused.returncode == 1
    assert refused.stderr.startswith("Set RAY_AUTH_TOKEN")


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_job_is_followed_stopped_and_resumed_while_nodes_come_and_go(cluster, redis, tmp_path):
    records = RunRecords(connect(redis.url))
    words = submission(tmp_path / "long", "--until-success", "0")
    words[words.index("--") : words.index("--")] = ["--no-wait", "--submission-id", "long"]
    assert cluster.ray(*words).returncode == 0
    wait_until(lambda: "long" in records.runs() and len(records.workers("long")) == 2)
    records.request("long", "pause")  # or it computes more rounds than can be compared in a test
    with cluster.node("worker"):
        wait_until(lambda: len(records.workers("long")) == 3)
    wait_until(lambda: len(records.workers("long")) == 2)
    before = records.status("long").version
    records.request("long", "resume")
    wait_until(lambda: records.status("long").version > before)
    assert "round" in cluster.ray(*documented("ray job logs")[:2], "long").stdout
    assert "RUNNING" in cluster.ray(*documented("ray job status")[:2], "long").stdout
    stopped = cluster.ray(*documented("ray job stop")[:2], "long")
    assert stopped.returncode == 0, stopped.stderr
    wait_until(lambda: records.status("long").state == "stopped")
    rounds = records.status("long").version + 2
    words = submission(tmp_path / "long", "--resume", "--rounds", str(rounds), "--until-success", "0")
    resumed = cluster.ray(*words)
    assert f"{rounds} rounds are done" in resumed.stdout, resumed.stdout + resumed.stderr
    assert taskschema("hash", str(tmp_path / "long")) == embedded_hash(tmp_path / "here", rounds)


def wait_until(condition, seconds=240.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not come true in time"
        time.sleep(0.1)
