"""Known secrets stand nowhere: not in logs, the run folder, process lists, nor in what the API tells."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import httpx
import psutil
import pytest
from processes import command_line
from role_redis import RoleRedis, role_redis

COMMAND = str(Path(sys.executable).with_name("taskschema"))
API_SECRETS = {
    "TASKSCHEMA_API_TOKEN": "known-control-token-0123456789",
    "TASKSCHEMA_API_READ_TOKEN": "known-read-token-0123456789",
    "TASKSCHEMA_API_ROBOT_TOKEN": "known-robot-token-0123456789",
}
RAY_SECRET = "known-ray-token-0123456789abcdef"
PATHS = ("/runs", "/runs/run", "/workers", "/metrics", "/policy/meta", "/openapi.json", "/schema")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory):
    with role_redis(tmp_path_factory.mktemp("redis")) as running:
        yield running


def secrets_of(server: RoleRedis) -> list[str]:
    return [*server.passwords.values(), *API_SECRETS.values(), RAY_SECRET]


@pytest.fixture(scope="module")
def evidence(server: RoleRedis) -> Iterator[dict[str, str]]:
    """Everything that a training with workers shows, while it runs and afterwards, by where it was seen."""
    # Short, because Ray's Unix sockets lie below.
    with tempfile.TemporaryDirectory(prefix="secrets-") as folder:
        yield collected(server, Path(folder))


def collected(server: RoleRedis, folder: Path) -> dict[str, str]:
    environment = {
        **os.environ,
        **API_SECRETS,
        "RAY_AUTH_TOKEN": RAY_SECRET,
        "TASKSCHEMA_REDIS_URL": server.url("learner"),
        "TASKSCHEMA_WORKER_REDIS_URL": server.url("worker"),
        "TASKSCHEMA_API_REDIS_URL": server.url("api"),
        "TASKSCHEMA_LOG_FORMAT": "json",
        "TMPDIR": str(folder),
    }
    words = ["train", "toy", "--run-dir", str(folder / "run"), "--workers", "1", "--until-success", "0"]
    seen = {}
    with (folder / "output").open("w") as output:
        training = subprocess.Popen(
            [COMMAND, *words, "--slots", "10", "--api", "127.0.0.1:0"],
            env=environment,
            stdout=output,
            stderr=output,
        )
        try:
            url = wait_for_rounds(training, folder / "output", 3)
            processes = [psutil.Process(training.pid), *psutil.Process(training.pid).children(recursive=True)]
            commands = {process.pid: command_line(process) for process in processes}
            seen["process list"] = "\n".join(commands.values())
            (actor,) = [pid for pid, command in commands.items() if "RolloutActor" in command]
            os.kill(actor, signal.SIGKILL)  # Ray must not talk of it amid the JSON
            wait_for_rounds(training, folder / "output", 100)
            bearer = {"Authorization": f"Bearer {API_SECRETS['TASKSCHEMA_API_READ_TOKEN']}"}
            for path in PATHS:
                answer = httpx.get(url + path, headers=bearer)
                assert answer.status_code == 200, path
                seen[path] = answer.text
            for path in folder.rglob("*"):  # the run's folder, and Ray's with all its logs
                if path.is_file():
                    seen[str(path.relative_to(folder))] = path.read_bytes().decode(errors="replace")
        finally:
            training.terminate()
            training.wait(60)
    seen["output"] = (folder / "output").read_text()
    return seen


def wait_for_rounds(training: subprocess.Popen[bytes], output: Path, rounds: int) -> str:
    """Wait until so many rounds are done and return the API's address."""
    from bus_setup import wait_until

    def are_done() -> bool:
        assert training.poll() is None, output.read_text()
        return output.read_text().count('"message":"Round done"') >= rounds

    wait_until(are_done, seconds=120)
    match = re.search(r'"api":"(http[^"]+)"', output.read_text())
    assert match is not None
    return match[1]


def test_no_known_secret_is_seen_anywhere(server: RoleRedis, evidence: dict[str, str]) -> None:
    assert any(name.startswith("taskschema-") for name in evidence), "Ray's folder is among it"
    assert "run/config.json" in evidence
    for where, text in evidence.items():
        for secret in secrets_of(server):
            assert secret not in text, where


def test_workers_under_their_own_user_are_refused_nothing(evidence: dict[str, str]) -> None:
    for where, text in evidence.items():
        assert "has no permissions" not in text, where


def test_the_log_is_json_with_run_and_round(evidence: dict[str, str]) -> None:
    for name in ("output", "run/log.jsonl"):
        lines = [json.loads(line) for line in evidence[name].splitlines()]
        assert {line["run"] for line in lines if "run" in line} == {"run"}
        done = [line for line in lines if line["message"] == "Round done"]
        assert [line["round"] for line in done] == list(range(len(done)))
        assert done[0]["episodes"] == 40
    delivered = [
        json.loads(line)
        for name, text in evidence.items()
        if name.endswith(".err")
        for line in text.splitlines()
        if '"Delivered' in line
    ]
    assert delivered
    assert {"run", "worker", "round", "slots", "time", "level", "part"} <= set(delivered[0])
