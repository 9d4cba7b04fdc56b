import os

import msgspec
import pytest
import redis
from api_setup import RUN, metrics

from taskschema.bus.keys import RunKeys
from taskschema.bus.worker_info import WorkerInfo
from taskschema.config import RunConfig
from taskschema.metrics import RoundMetrics


def test_runs_are_listed(served):
    served.records.register_run("other", RunConfig(task="toy", policy="state", seed=7))
    runs = served.http.get("/runs").json()["runs"]
    assert [run["run"] for run in runs] == ["other", RUN]
    assert (runs[0]["policy"], runs[0]["seed"], runs[0]["state"]) == ("state", 7, "starting")
    assert (runs[1]["task"], runs[1]["state"], runs[1]["version"]) == ("toy", "running", 3)


def test_a_run_in_detail(served):
    details = served.http.get(f"/runs/{RUN}").json()
    assert details["config"]["ppo"]["learning_rate"] == 0.001
    assert details["config_hash"] == RunConfig(task="toy").config_hash
    assert details["status"]["state"] == "running"
    assert msgspec.convert(details["latest"], RoundMetrics) == metrics(3)
    assert (details["worker_target"], details["workers"]) == (None, 0)


def test_the_curve_and_its_tail(served):
    curve = served.http.get(f"/runs/{RUN}/curve").json()
    assert msgspec.convert(curve["rounds"], list[RoundMetrics]) == [metrics(1), metrics(2), metrics(3)]
    tail = served.http.get(f"/runs/{RUN}/curve?since=2").json()["rounds"]
    assert [row["round"] for row in tail] == [2]
    assert served.http.get(f"/runs/{RUN}/curve?since=3").json()["rounds"] == []


@pytest.mark.parametrize("since", ["-1", "x", "1e9", "9" * 30])
def test_a_wrong_since_is_refused(served, since):
    assert served.http.get(f"/runs/{RUN}/curve", params={"since": since}).status_code == 422


@pytest.mark.parametrize("path", ["/runs/nobody", "/runs/nobody/curve", "/runs/%20", "/runs/A%00B"])
def test_an_unknown_run(served, path):
    answer = served.http.get(path)
    assert answer.status_code == 404
    assert answer.json()["detail"].endswith(f"Valid: {RUN}.")


def test_live_workers_are_listed(served, redis_url):
    client = redis.Redis.from_url(redis_url)
    info = WorkerInfo(
        id="worker-1",
        kind="simulation",
        host="here",
        pid=os.getpid(),
        since="2026-01-02T03:04:05+00:00",
        last_seen=0.0,
        episodes=12,
        busy_slots=2,
        episodes_per_second=3.5,
    )
    gone = msgspec.structs.replace(info, id="worker-2")
    keys = RunKeys(RUN)
    now = client.time()[0]
    for worker, seen in ((info, now), (gone, now - 3600)):
        client.hset(keys.workers, worker.id, msgspec.json.encode(worker))
        client.zadd(keys.heartbeats, {worker.id: seen})
    answer = served.http.get("/workers").json()
    assert (answer["run"], answer["target"], answer["live"]) == (RUN, None, 1)
    assert answer["workers"][0]["id"] == "worker-1"
    assert answer["workers"][0]["episodes_per_second"] == 3.5


def test_workers_are_scaled(served):
    answer = served.owner.put("/workers", json={"target": 3})
    assert (answer.status_code, answer.json()["target"]) == (200, 3)
    assert served.records.worker_target(RUN) == 3
    assert served.owner.put("/workers", json={"target": None}).json()["target"] is None
    assert served.records.worker_target(RUN) is None


@pytest.mark.parametrize(
    "body", [{}, {"target": 0}, {"target": -1}, {"target": "3"}, {"target": 2.5}, {"target": 10**9}, [], 3]
)
def test_a_wrong_target_changes_nothing(served, body):
    assert served.owner.put("/workers", json=body).status_code == 422
    assert served.records.worker_target(RUN) is None


def test_pause_resume_and_stop_reach_the_learner(served):
    answer = served.owner.post(f"/runs/{RUN}/pause")
    assert answer.status_code == 202
    assert answer.json() == {"run": RUN, "requested": "pause", "state": "running"}
    assert served.records.pause_requested(RUN)
    assert served.owner.post(f"/runs/{RUN}/resume").status_code == 202
    assert not served.records.pause_requested(RUN)
    assert served.owner.post(f"/runs/{RUN}/stop").status_code == 202
    assert served.records.stop_requested(RUN)


@pytest.mark.parametrize("state", ["finished", "stopped", "failed"])
def test_a_run_that_ended_does_nothing_any_more(served, state):
    served.records.set_state(RUN, state)
    for request in ("pause", "resume", "stop"):
        answer = served.owner.post(f"/runs/{RUN}/{request}")
        assert answer.status_code == 409
        assert f"is {state}" in answer.json()["detail"]
    assert served.owner.put("/workers", json={"target": 2}).status_code == 409
    assert not served.records.pause_requested(RUN)


def test_requests_to_an_unknown_run(served):
    assert served.owner.post("/runs/nobody/pause").status_code == 404
    assert served.owner.put("/workers?run=nobody", json={"target": 2}).status_code == 404
