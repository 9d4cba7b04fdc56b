"""Tokens: kept by their hash, made by a command, taken up at once; wrong ones are counted."""

import hmac
import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest
from api_setup import RUN, TOKEN

from taskschema.errors import ConfigError
from taskschema_learner.api import tokens as module
from taskschema_learner.api.process import ApiProcess
from taskschema_learner.api.rates import DEFAULTS, Rates
from taskschema_learner.api.tokens import FILE_VARIABLE, Tokens, new_token, read_tokens, stored

COMMAND = str(Path(sys.executable).with_name("taskschema"))


def make(file: Path, *words: str) -> str:
    command = [COMMAND, "token", *words, "--file", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@contextmanager
def started(redis_url: str) -> Iterator[httpx.Client]:
    """A client of an API with the environment of now."""
    with (
        ApiProcess(redis_url, RUN, "127.0.0.1:0", token=TOKEN) as api,
        httpx.Client(base_url=api.url, timeout=30) as http,
    ):
        yield http


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def test_the_command_makes_replaces_and_revokes_while_the_api_runs(redis_url, served, tmp_path, monkeypatch):
    file = tmp_path / "tokens.json"
    first = make(file, "grafana")
    assert first not in file.read_text()
    assert file.stat().st_mode & 0o077 == 0
    monkeypatch.setenv(FILE_VARIABLE, str(file))
    with (
        ApiProcess(redis_url, RUN, "127.0.0.1:0", token=TOKEN) as api,
        httpx.Client(base_url=api.url) as http,
    ):
        assert http.get("/metrics").status_code == 401
        assert http.get("/metrics", headers=bearer(first)).status_code == 200
        assert http.put("/workers", json={"target": 1}, headers=bearer(first)).status_code == 403
        second = make(file, "grafana", "--scope", "read", "--scope", "control", "--days", "0")
        assert http.get("/metrics", headers=bearer(first)).status_code == 401
        assert http.put("/workers", json={"target": 1}, headers=bearer(second)).status_code == 200
        make(file, "grafana", "--revoke")
        assert http.put("/workers", json={"target": 1}, headers=bearer(second)).status_code == 401
        assert http.get("/metrics").status_code == 200
        make(file, "grafana")
        assert http.get("/metrics").status_code == 401, "taken up by a request without a token"
        file.write_text("damaged")
        assert http.put("/workers", json={"target": 1}, headers=bearer(second)).status_code == 401
        assert http.get("/metrics").status_code == 401
        assert http.put("/workers", json={"target": None}, headers=bearer(TOKEN)).status_code == 200


@pytest.mark.parametrize("scope", ["read", "control"])
def test_reading_stays_guarded_while_the_file_cannot_be_read(tmp_path, scope):
    file = tmp_path / "tokens.json"
    token = make(file, "a", "--scope", scope)
    tokens = Tokens((), file)
    assert tokens.guards_reading == (scope == "read")
    file.rename(tmp_path / "elsewhere")
    assert tokens.guards_reading, "who was given a token since is unknown"
    assert tokens.scopes_of(token) == frozenset()
    (tmp_path / "elsewhere").rename(file)
    assert tokens.guards_reading == (scope == "read")
    assert tokens.scopes_of(token) == {scope}


def test_a_token_ends(tmp_path):
    token, now = new_token(), datetime.now(UTC)
    held = Tokens([stored("a", token, ["read"], now + timedelta(seconds=60))])
    ended = Tokens([stored("a", token, ["read"], now)])
    assert (held.scopes_of(token), ended.scopes_of(token)) == ({"read"}, frozenset())


def test_every_known_token_is_compared_in_constant_time(monkeypatch):
    compared = []
    plain = hmac.compare_digest

    def compare(known, given):
        compared.append((len(known), len(given)))
        return plain(known, given)

    known = [new_token() for _ in range(3)]
    tokens = Tokens([stored(str(number), token, ["read"]) for number, token in enumerate(known)])
    monkeypatch.setattr(module.hmac, "compare_digest", compare)
    for token in (known[0], known[0][:-1], "", "x" * 10_000):
        compared.clear()
        tokens.scopes_of(token)
        assert compared == [(64, 64)] * 3, "the first match ends nothing, and no length is told"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "no file of tokens"),
        ('{"tokens": [{"name": "a", "sha256": "short", "scopes": ["read"]}]}', "no file of tokens"),
        (json.dumps({"tokens": [{"name": "a", "sha256": "0" * 64, "scopes": ["all"]}]}), "no file of tokens"),
        (None, "No such file"),
    ],
)
def test_a_file_that_is_none_is_one_clear_line(tmp_path, content, reason):
    file = tmp_path / "tokens.json"
    if content is not None:
        file.write_text(content)
    with pytest.raises(ConfigError, match=reason) as caught:
        Tokens.of("a-token", {FILE_VARIABLE: str(file)})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("words", [["a", "--scope", "all"], ["nobody", "--revoke"], ["", "--days", "1"]])
def test_the_command_refuses_in_one_line(tmp_path, words):
    file = tmp_path / "tokens.json"
    done = subprocess.run([COMMAND, "token", *words, "--file", str(file)], capture_output=True, text=True)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert not file.exists() or read_tokens(file).tokens == ()


def test_too_many_wrong_tokens_close_the_door(redis_url, served, monkeypatch):
    monkeypatch.setenv("TASKSCHEMA_API_FAILURE_LIMIT", "5/hour")
    with (
        ApiProcess(redis_url, RUN, "127.0.0.1:0", token=TOKEN) as api,
        httpx.Client(base_url=api.url) as http,
    ):
        tries = [http.post(f"/runs/{RUN}/stop", headers=bearer(f"guess-{n}")).status_code for n in range(7)]
        assert tries == [401] * 5 + [429] * 2
        answer = http.put("/workers", json={"target": 1}, headers=bearer(TOKEN))
        assert answer.status_code == 429
        assert answer.headers["retry-after"]
        assert "wait" in answer.json()["detail"]
        assert http.get("/schema").status_code == 200, "what needs no token is not concerned"


def test_too_many_requests_and_changes_wait(redis_url, served, monkeypatch):
    monkeypatch.setenv("TASKSCHEMA_API_REQUEST_LIMIT", "20/hour")
    monkeypatch.setenv("TASKSCHEMA_API_CHANGE_LIMIT", "3/hour")
    with (
        ApiProcess(redis_url, RUN, "127.0.0.1:0", token=TOKEN) as api,
        httpx.Client(base_url=api.url) as http,
    ):
        changes = [http.put("/workers", json={"target": 1}, headers=bearer(TOKEN)) for _ in range(5)]
        assert [answer.status_code for answer in changes] == [200] * 3 + [429] * 2
        reads = [http.get("/schema").status_code for _ in range(20)]
        assert reads[0] == 200
        assert reads[-1] == 429
        assert reads == sorted(reads)


@pytest.mark.parametrize("text", ["", "many", "10", "10/fortnight"])
def test_a_limit_that_is_none_is_one_clear_line(text):
    with pytest.raises(ConfigError, match="such as 20/second"):
        Rates.of({**DEFAULTS, "TASKSCHEMA_API_CHANGE_LIMIT": text})
