import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import httpx
import psutil
import pytest
from api_setup import RUN, TOKEN

from taskschema.bus.url import REDIS_VARIABLE
from taskschema.errors import ConfigError
from taskschema_learner.api.address import Address
from taskschema_learner.api.process import ApiProcess
from taskschema_learner.api.tokens import TOKEN_VARIABLE, Tokens, new_token

CHANGES = [
    ("PUT", "/workers"),
    ("POST", f"/runs/{RUN}/pause"),
    ("POST", f"/runs/{RUN}/resume"),
    ("POST", f"/runs/{RUN}/stop"),
    ("POST", "/runs/nobody/stop"),
    ("DELETE", "/schema"),
]
WRONG_TOKENS = [
    None,
    "",
    "Bearer",
    "Bearer wrong",
    f"Basic {TOKEN}",
    f"Bearer {TOKEN}x",
    f"Bearer {TOKEN[:-1]}",
    TOKEN,
    "Bearer é",
]
READS = ["/schema", "/policy", "/metrics", "/runs", "/events", "/docs", "/openapi.json", "/nothing"]


@pytest.mark.parametrize(("method", "path"), CHANGES)
def test_changes_need_the_token(served, method, path):
    for header in WRONG_TOKENS:
        headers = {} if header is None else {"Authorization": header.encode("latin-1")}
        answer = served.http.request(method, path, json={"target": 2}, headers=headers)
        assert answer.status_code == 401, header
        assert answer.headers["www-authenticate"] == 'Bearer realm="taskschema"'
        assert "Authorization: Bearer TOKEN" in answer.json()["detail"]
    assert served.records.worker_target(RUN) is None
    assert not served.records.stop_requested(RUN)


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8420", "127.0.0.1.evil.example", "", "[::1"])
def test_a_foreign_host_header_is_refused_on_loopback(served, host):
    answer = served.http.get("/schema", headers={"Host": host})
    assert answer.status_code == 400


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "localhost:1", "[::1]:8420", "LOCALHOST"])
def test_names_of_loopback_are_answered(served, host):
    assert served.http.get("/schema", headers={"Host": host}).status_code == 200


def test_no_other_origin_may_read(served):
    answer = served.http.get("/schema", headers={"Origin": "https://evil.example"})
    assert not any(name.startswith("access-control") for name in answer.headers)
    preflight = served.http.options(
        "/workers",
        headers={"Origin": "https://evil.example", "Access-Control-Request-Method": "PUT"},
    )
    assert preflight.status_code == 405


def test_beyond_loopback_everything_but_probes_needs_the_token(redis_url, served):
    with ApiProcess(redis_url, RUN, "0.0.0.0:0", token=TOKEN) as api:
        url = f"http://127.0.0.1:{api.url.rpartition(':')[2]}"
        for path in READS:
            assert httpx.get(url + path).status_code == 401, path
        assert httpx.post(f"{url}/act", json={}).status_code == 401
        assert httpx.get(f"{url}/healthz").status_code == 200
        assert httpx.get(f"{url}/readyz").status_code == 200
        bearer = {"Authorization": f"bearer {TOKEN}", "Host": "learner.example"}
        assert httpx.get(f"{url}/schema", headers=bearer).status_code == 200


def test_a_token_comes_from_the_environment_or_is_made(monkeypatch):
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    made = ApiProcess("redis://", RUN, "127.0.0.1:0")
    assert made.token_is_generated
    assert len(made.token) >= 32
    assert made.token != ApiProcess("redis://", RUN, "127.0.0.1:0").token
    monkeypatch.setenv(TOKEN_VARIABLE, "mine")
    given = ApiProcess("redis://", RUN, "127.0.0.1:0")
    assert (given.token, given.token_is_generated) == ("mine", False)


@pytest.mark.parametrize("token", ["", "two words", "tab\t", "umläut", "line\n"])
def test_a_token_that_no_header_can_carry_is_refused(token):
    with pytest.raises(ConfigError, match=TOKEN_VARIABLE):
        Tokens.of(token, {})


@pytest.mark.parametrize(
    ("text", "host", "port", "loopback"),
    [
        ("127.0.0.1:8420", "127.0.0.1", 8420, True),
        (":0", "127.0.0.1", 0, True),
        ("localhost:1", "localhost", 1, True),
        ("[::1]:65535", "::1", 65535, True),
        ("127.8.8.8:1", "127.8.8.8", 1, True),
        ("0.0.0.0:80", "0.0.0.0", 80, False),
        ("[::]:80", "::", 80, False),
        ("learner.example:80", "learner.example", 80, False),
    ],
)
def test_addresses(text, host, port, loopback):
    address = Address.parse(text)
    assert (address.host, address.port, address.is_loopback) == (host, port, loopback)


@pytest.mark.parametrize(
    "text", ["", "8420", "host", "host:", "host:x", "host:65536", "::1:80", "host:-1", "host:²"]
)
def test_what_is_no_address(text):
    with pytest.raises(ConfigError, match="HOST:PORT"):
        Address.parse(text)


def test_tokens_are_long_and_differ():
    assert len({new_token() for _ in range(100)}) == 100
    assert all(len(new_token()) == 32 for _ in range(10))


def command(redis_url, *arguments):
    environment = {**os.environ, REDIS_VARIABLE: redis_url, TOKEN_VARIABLE: TOKEN}
    return subprocess.Popen(
        [sys.executable, "-m", "taskschema_learner.api", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )


def refusal(redis_url, *arguments):
    """Return the exit status and the only line that the command prints."""
    process = command(redis_url, *arguments)
    printed, error = process.communicate(timeout=30)
    assert printed == ""
    (line,) = error.splitlines()
    return process.returncode, line


def test_a_busy_port_is_one_clear_line(redis_url):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        expected = (
            f"Port {port} on 127.0.0.1 is in use: stop what listens there, "
            "or choose another port (0 takes any free one)."
        )
        assert refusal(redis_url, "--port", str(port)) == (1, expected)
        with pytest.raises(ConfigError) as error, ApiProcess(redis_url, RUN, f"127.0.0.1:{port}"):
            pass
        assert str(error.value) == expected


def test_an_unreachable_redis_is_one_clear_line():
    with socket.create_server(("127.0.0.1", 0)) as closed:
        url = f"redis://:secret-word@127.0.0.1:{closed.getsockname()[1]}"
    status, line = refusal(url, "--port", "0")
    assert status == 1
    assert line.startswith("Redis does not answer")
    assert "secret-word" not in line
    with (
        pytest.raises(ConfigError, match="The API did not start: Redis does not answer"),
        ApiProcess(url, RUN, "127.0.0.1:0"),
    ):
        pass


def test_no_redis_url_says_which_variable():
    status, line = refusal("", "--port", "0")
    assert (status, REDIS_VARIABLE in line) == (1, True)


def test_a_host_that_is_not_ours_is_one_clear_line(redis_url):
    status, line = refusal(redis_url, "--host", "192.0.2.1", "--port", "0")
    assert status == 1
    assert line.startswith("The API cannot listen on 192.0.2.1:0")


def test_secrets_stand_in_no_process_list(redis_url, api_url):
    password = redis_url.partition("://:")[2].partition("@")[0]
    commands = [
        " ".join(child.cmdline())
        for child in psutil.Process().children(recursive=True)
        if "taskschema_learner.api" in child.cmdline()
    ]
    assert commands
    assert not any(TOKEN in line or password in line for line in commands)


def test_it_dies_with_its_parent(redis_url):
    script = (
        "import sys, time\n"
        "from taskschema_learner.api.process import ApiProcess\n"
        "with ApiProcess(sys.stdin.readline().strip(), None, '127.0.0.1:0') as api:\n"
        "    print(api._process.pid, flush=True)\n"
        "    time.sleep(60)\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    parent.stdin.write(redis_url + "\n")
    parent.stdin.flush()
    api = psutil.Process(int(parent.stdout.readline()))
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    _, alive = psutil.wait_procs([api], timeout=10)
    assert not alive


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_stops_without_a_word(redis_url, number):
    process = command(redis_url, "--port", "0", "--run", RUN)
    assert process.stdout.readline().startswith("API: http://127.0.0.1:")
    process.send_signal(number)
    _, error = process.communicate(timeout=10)
    assert (process.returncode, error) == (0, "")


def test_the_api_imports_neither_simulator_nor_torch():
    script = (
        "import sys\n"
        "import taskschema_learner.api.command, taskschema_learner.api.redis_source\n"
        "import taskschema_learner.api.folder_source, taskschema_learner.api.server\n"
        "print(*{name.split('.')[0] for name in sys.modules})"
    )
    names = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=True
    ).stdout.split()
    assert "fastapi" in names
    assert not {"torch", "mujoco", "robosuite", "ray", "gymnasium"} & set(names)


def test_the_documentation_needs_no_other_server(served):
    page = served.http.get("/docs").text
    assert "https://" not in page
    for path in ("/docs/static/swagger-ui-bundle.js", "/docs/static/swagger-ui.css"):
        assert path in page
        assert served.http.get(path).status_code == 200
    assert served.http.get("/", follow_redirects=False).headers["location"] == "/docs"


def test_every_endpoint_is_described(served):
    description = served.http.get("/openapi.json").json()
    for path, methods in description["paths"].items():
        for method, operation in methods.items():
            assert operation["tags"], (path, method)
            assert operation["description"], (path, method)
    assert {
        "/healthz",
        "/readyz",
        "/metrics",
        "/schema",
        "/policy",
        "/policy/meta",
        "/act",
        "/runs",
        "/runs/{run}",
        "/runs/{run}/curve",
        "/runs/{run}/pause",
        "/runs/{run}/resume",
        "/runs/{run}/stop",
        "/workers",
        "/events",
    } == set(description["paths"])
    row = description["components"]["schemas"]["RoundMetrics"]["properties"]["seconds_collect"]
    assert row["description"] == "Wall time from opening the round to its last slot [s]."


def test_every_endpoint_is_documented(served):
    text = (Path(__file__).parents[3] / "docs/api.md").read_text(encoding="utf-8")
    documented = {tuple(line.split()[1:]) for line in text.splitlines() if re.match(r"## [A-Z]+ /", line)}
    described = served.http.get("/openapi.json").json()["paths"]
    assert documented == {(method.upper(), path) for path, methods in described.items() for method in methods}
