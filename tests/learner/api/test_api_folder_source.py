import os
import signal
import subprocess
import sys

import httpx
import msgspec
import pytest
from api_setup import TOKEN, document, metrics, snapshot

from taskschema.config import RunConfig
from taskschema.policies import PolicySnapshot
from taskschema.schema import SchemaDocument
from taskschema_learner.api.folder_source import FolderSource
from taskschema_learner.api.problems import ConflictError
from taskschema_learner.api.tokens import TOKEN_VARIABLE
from taskschema_learner.runs.folder_state import FINISH, mark_finished
from taskschema_learner.runs.run_folder import RunFolder

NAME = "finished-run"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = RunFolder.create(tmp_path_factory.mktemp("runs") / NAME, RunConfig(task="toy", seed=5))
    for version in (1, 2):
        folder.append_metrics(metrics(version))
    folder.write_schema(document(NAME, 2))
    folder.write_policy(snapshot(2).to_bytes())
    mark_finished(folder, 2, "2 rounds are done")
    return folder


def command(path, **environment):
    return subprocess.Popen(
        [sys.executable, "-m", "taskschema_learner.api", "--folder", str(path), "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **environment},
    )


@pytest.fixture(scope="module")
def url(folder):
    process = command(folder.path, **{TOKEN_VARIABLE: TOKEN})
    yield process.stdout.readline().split()[1]
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=10)[1] == ""


def test_schema_and_policy(url):
    schema = httpx.get(f"{url}/schema")
    assert msgspec.json.decode(schema.content, type=SchemaDocument) == document(NAME, 2)
    assert httpx.get(f"{url}/schema?version=2").status_code == 200
    older = httpx.get(f"{url}/schema?version=1")
    assert older.status_code == 404
    assert older.json()["detail"] == f"The folder of run '{NAME}' keeps schema version 2 only."
    policy = httpx.get(f"{url}/policy")
    assert PolicySnapshot.from_bytes(policy.content).sha256 == snapshot(2).sha256
    assert httpx.get(f"{url}/policy", headers={"If-None-Match": policy.headers["etag"]}).status_code == 304


def test_run_curve_workers_and_metrics(url):
    details = httpx.get(f"{url}/runs/{NAME}").json()
    assert (details["status"]["state"], details["status"]["version"]) == ("finished", 2)
    assert details["status"]["message"] == "served from the run's folder: 2 rounds are done"
    assert details["config"]["seed"] == 5
    rows = httpx.get(f"{url}/runs/{NAME}/curve").json()["rounds"]
    assert [row["policy_version"] for row in rows] == [1, 2]
    assert httpx.get(f"{url}/workers").json()["workers"] == []
    assert f'taskschema_episodes_total{{run="{NAME}"}} 400.0' in httpx.get(f"{url}/metrics").text
    assert httpx.get(f"{url}/readyz").status_code == 200


def test_acting(url):
    answer = httpx.post(f"{url}/act", json={"observation": [0.0] * 9, "step": 0, "mode": "mean"})
    assert answer.json()["pair"] == ["reach", "reach"]


def test_events_are_the_rounds_that_were(url):
    with httpx.stream("GET", f"{url}/events?replay=true", timeout=10) as answer:
        found = []
        for line in answer.iter_lines():
            found.append(line)
            if line.startswith("event: status"):
                break
    assert [line for line in found if line.startswith("id:")] == ["id: 1-0", "id: 2-0"]


@pytest.mark.parametrize("request_", ["pause", "resume", "stop"])
def test_a_finished_run_refuses_requests(url, request_):
    bearer = {"Authorization": f"Bearer {TOKEN}"}
    assert httpx.post(f"{url}/runs/{NAME}/{request_}").status_code == 401
    answer = httpx.post(f"{url}/runs/{NAME}/{request_}", headers=bearer)
    assert answer.status_code == 409
    assert answer.json()["detail"].startswith("This run is finished")
    assert httpx.put(f"{url}/workers", json={"target": 1}, headers=bearer).status_code == 409


def test_a_run_that_is_not_finished_is_not_called_so(tmp_path):
    folder = RunFolder.create(tmp_path / "run", RunConfig(task="toy"))
    folder.append_metrics(metrics(1))
    source = FolderSource(folder.path)
    assert source.status("run").state == "stopped"
    with pytest.raises(ConflictError, match="is stopped: continue it with"):
        source.request("run", "pause")
    mark_finished(folder, 1, "1 rounds are done")
    with folder.locked():
        assert source.status("run").state == "running"
        with pytest.raises(ConflictError, match="send them to its own API"):
            source.request("run", "stop")
        with pytest.raises(ConflictError, match="send them to its own API"):
            source.set_worker_target("run", 1)
    assert source.status("run").state == "finished"
    folder.append_metrics(metrics(2))
    assert source.status("run").state == "stopped", "it went on after it had finished"
    mark_finished(folder, 2, "2 rounds are done")
    (folder.path / FINISH).write_bytes(b"damaged")
    assert source.status("run").state == "stopped"


def test_an_unknown_run(url):
    for path in ("/schema?run=other", "/runs/other", "/runs/other/curve"):
        answer = httpx.get(url + path)
        assert answer.status_code == 404
        assert NAME in answer.json()["detail"]


def test_a_run_without_a_round_has_nothing_to_show(tmp_path):
    RunFolder.create(tmp_path / "empty", RunConfig(task="toy"))
    process = command(tmp_path / "empty", **{TOKEN_VARIABLE: TOKEN})
    url = process.stdout.readline().split()[1]
    try:
        assert httpx.get(f"{url}/schema").status_code == 404
        assert httpx.get(f"{url}/policy").status_code == 404
        assert httpx.get(f"{url}/runs/empty").json()["latest"] is None
        assert httpx.get(f"{url}/runs/empty/curve").json()["rounds"] == []
        (tmp_path / "empty" / "policy.safetensors").write_bytes(b"damaged")
        assert httpx.get(f"{url}/policy").status_code == 503
    finally:
        process.terminate()
        process.communicate(timeout=10)


def test_a_token_is_made_and_printed(folder):
    environment = {name: value for name, value in os.environ.items() if name != TOKEN_VARIABLE}
    process = subprocess.Popen(
        [sys.executable, "-m", "taskschema_learner.api", "--folder", str(folder.path), "--port", "0"],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    url = process.stdout.readline().split()[1]
    token = process.stdout.readline().split()[-1]
    try:
        bearer = {"Authorization": f"Bearer {token}"}
        assert httpx.post(f"{url}/runs/{NAME}/stop", headers=bearer).status_code == 409
    finally:
        process.terminate()
        process.communicate(timeout=10)


def test_no_run_is_one_clear_line(tmp_path):
    process = command(tmp_path)
    printed, error = process.communicate(timeout=30)
    assert (process.returncode, printed, len(error.splitlines())) == (1, "", 1)
    assert "no config.json" in error
