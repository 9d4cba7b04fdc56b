"""What clients see while Redis or the run's files cannot be read."""

import os
import signal
import threading

import httpx
from api_setup import RUN, TOKEN, trained_run

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema_learner.api.process import ApiProcess
from taskschema_learner.embedded_redis import EmbeddedRedis

READS = ["/readyz", "/schema", "/policy", "/policy/meta", "/runs", f"/runs/{RUN}", "/workers", "/events"]


def test_without_redis_every_answer_is_503_and_says_so(tmp_path):
    with EmbeddedRedis(tmp_path / "redis") as server:
        trained_run(RunRecords(connect(server.url)), RUN)
        api = ApiProcess(server.url, RUN, "127.0.0.1:0", token=TOKEN)
        api.__enter__()
    try:
        with httpx.Client(base_url=api.url, timeout=10) as client:
            for path in READS:
                answer = client.get(path)
                assert answer.status_code == 503, path
                assert int(answer.headers["retry-after"]) > 0
                assert answer.json()["detail"].startswith("Redis does not answer")
                assert "\n" not in answer.json()["detail"]
            act = client.post("/act", json={"observation": [0] * 9, "step": 0})
            assert act.status_code == 503
            owner = {"Authorization": f"Bearer {TOKEN}"}
            assert client.put("/workers", json={"target": 2}, headers=owner).status_code == 503
            assert client.get("/healthz").status_code == 200
            assert "taskschema_source_up 0.0" in client.get("/metrics").text
    finally:
        api.__exit__(None, None, None)


def test_it_goes_on_when_redis_was_killed_and_came_back(tmp_path):
    with EmbeddedRedis(tmp_path / "redis") as server:
        trained_run(RunRecords(connect(server.url)), RUN)
        with ApiProcess(server.url, RUN, "127.0.0.1:0") as api, httpx.Client(base_url=api.url) as client:
            assert client.get("/schema").json()["version"] == 3
            os.kill(server.pid, signal.SIGKILL)
            seen = []
            while not seen or seen[-1] != 200:
                seen.append(client.get("/runs").status_code)
                threading.Event().wait(0.05)
            assert set(seen) <= {200, 503}
            assert client.get("/schema").json()["version"] == 3


def test_a_redis_that_hangs_holds_nobody_for_long(tmp_path):
    with EmbeddedRedis(tmp_path / "redis") as server:
        trained_run(RunRecords(connect(server.url)), RUN)
        with ApiProcess(server.url, RUN, "127.0.0.1:0") as api:
            assert httpx.get(f"{api.url}/schema").status_code == 200
            os.kill(server.pid, signal.SIGSTOP)
            try:
                assert httpx.get(f"{api.url}/policy", timeout=10).status_code == 503
                assert httpx.get(f"{api.url}/healthz", timeout=1).status_code == 200
            finally:
                os.kill(server.pid, signal.SIGCONT)
            assert httpx.get(f"{api.url}/policy").status_code == 200
