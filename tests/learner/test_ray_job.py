"""A training submitted to an existing Ray cluster, with the very command that docs/cluster.md shows."""

import json
import os
import re
import secrets
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from taskschema_learner.embedded_redis import EmbeddedRedis

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@pytest.fixture
def cluster():
    """A local cluster of `ray start`, on loopback, with token authentication; yields where it takes jobs."""
    with tempfile.TemporaryDirectory(prefix="ray-") as folder:
        dashboard = free_port()
        environment = {
            **os.environ,
            "PATH": f"{BIN}:{os.environ['PATH']}",
            "RAY_USAGE_STATS_ENABLED": "0",
            "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",
            "RAY_TMPDIR": folder,
            "RAY_AUTH_MODE": "token",
            "RAY_AUTH_TOKEN": secrets.token_hex(32),
        }
        head = [str(BIN / "ray"), "start", "--head", "--block", "--num-cpus=2", f"--port={free_port()}"]
        head += ["--node-ip-address=127.0.0.1", "--dashboard-host=127.0.0.1", f"--dashboard-port={dashboard}"]
        head += ["--object-store-memory=80000000", "--include-dashboard=true", f"--temp-dir={folder}"]
        head += [f"--dashboard-agent-listen-port={free_port()}"]
        process = subprocess.Popen(
            head,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        assert process.stdout is not None
        for line in process.stdout:
            if "ray job submit" in line or "To terminate" in line or "--block" in line:
                break
        try:
            yield f"http://127.0.0.1:{dashboard}", environment
        finally:
            process.terminate()
            process.wait(timeout=30)


def documented_command() -> list[str]:
    """Return the words of the `ray job submit` command in the docs."""
    text = (ROOT / "docs/cluster.md").read_text()
    match = re.search(r"^(ray job submit (?:.*\\\n)*.*)$", text, flags=re.MULTILINE)
    assert match is not None
    return match[1].replace("\\\n", " ").split()


def taskschema(*words: str) -> str:
    command = [str(BIN / "taskschema"), *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_training_is_submitted_to_a_cluster(cluster, tmp_path):
    address, environment = cluster
    two_rounds = ["--rounds", "2", "--until-success", "0"]
    with EmbeddedRedis(tmp_path / "redis") as redis:
        words = documented_command()
        changes = {
            "--address": address,
            "--runtime-env-json": json.dumps({"env_vars": {"TASKSCHEMA_REDIS_URL": redis.url}}),
            "train": "toy",
            "--run-dir": str(tmp_path / "job"),
        }
        for word, value in changes.items():
            words[words.index(word) + 1] = value
        done = subprocess.run(
            [str(BIN / words[0]), *words[1:], *two_rounds],
            env=environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=200,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert "2 rounds are done" in done.stdout
        assert redis.url not in done.stdout + done.stderr
    taskschema(
        "train", "toy", "--workers", "0", "--api", "none", "--run-dir", str(tmp_path / "here"), *two_rounds
    )
    assert taskschema("hash", str(tmp_path / "job")) == taskschema("hash", str(tmp_path / "here"))
