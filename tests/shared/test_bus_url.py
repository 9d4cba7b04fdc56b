"""The URL of Redis: TLS is checked, and the password stays out of sight."""

import os
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from tls import Certificates, make_certificates, tls_door

from taskschema.bus.connection import connect
from taskschema.bus.url import REDIS_VARIABLE, taken_out, without_secrets
from taskschema.errors import BusError
from taskschema_learner.embedded_redis import EmbeddedRedis

COMMAND = str(Path(sys.executable).with_name("taskschema"))
URL = "redis://user:secret@host:6379/0"


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    return make_certificates(tmp_path_factory.mktemp("certificates"))


def test_redis_behind_tls(shared_redis: EmbeddedRedis, certificates: Certificates) -> None:
    parts = urlsplit(shared_redis.url)
    assert parts.port is not None
    with tls_door(parts.port, certificates) as port:
        url = f"rediss://:{parts.password}@localhost:{port}"
        assert connect(f"{url}?ssl_ca_certs={certificates.ca}").ping()
        with pytest.raises(BusError, match=r"name the CA .* with \?ssl_ca_certs=FILE"):
            connect(url)
        with pytest.raises(BusError, match="does not answer"):
            connect(f"{url}?ssl_ca_certs=/no/such/file.pem")
        with pytest.raises(BusError, match="does not answer"):
            connect(f"redis://:{parts.password}@localhost:{port}")


def test_a_certificate_of_another_host_is_refused(
    shared_redis: EmbeddedRedis, certificates: Certificates
) -> None:
    parts = urlsplit(shared_redis.url)
    assert parts.port is not None
    door = tls_door(parts.port, certificates, "127.0.0.2")
    with door as port, pytest.raises(BusError, match="not valid for '127.0.0.2'"):
        connect(f"rediss://:{parts.password}@127.0.0.2:{port}?ssl_ca_certs={certificates.ca}")


@pytest.mark.parametrize("value", ["none", "optional"])
def test_tls_that_trusts_anybody_is_refused(value: str) -> None:
    with pytest.raises(BusError, match="would trust any server"):
        connect(f"rediss://:secret@localhost:1?ssl_cert_reqs={value}")


def test_an_unknown_option_is_one_clear_line() -> None:
    with pytest.raises(BusError, match="an option that is not known") as caught:
        connect("redis://:secret@localhost:1?ssl_ca=file")
    assert "secret" not in str(caught.value)


def test_url_without_secrets() -> None:
    assert without_secrets(f"{URL}?ssl_keyfile=x") == "redis://host:6379/0"


@pytest.mark.parametrize(
    ("words", "rest", "url"),
    [
        (["train", "toy", "--redis", URL, "--seed", "1"], ["train", "toy", "--seed", "1"], URL),
        (["train", f"--redis={URL}"], ["train"], URL),
        (["train", "--redis", "redis://host"], ["train", "--redis", "redis://host"], None),
        (["train", "--redis"], ["train", "--redis"], None),
        (["train", "toy"], ["train", "toy"], None),
        (["scale", "--redis", URL, "--redis", "redis://b"], ["scale", "--redis", "redis://b"], None),
    ],
)
def test_what_is_taken_off_the_command_line(words: list[str], rest: list[str], url: str | None) -> None:
    assert taken_out(words) == (rest, url)


@pytest.mark.parametrize(
    "program", [[COMMAND, "train", "toy", "--api", "none"], [sys.executable, "-m", "taskschema_worker"]]
)
def test_a_password_leaves_the_process_list(
    shared_redis: EmbeddedRedis, program: list[str], tmp_path
) -> None:
    password = str(urlsplit(shared_redis.url).password)
    options = ["--run", "none"]
    if "train" in program:
        options = ["--workers", "0", "--run-dir", str(tmp_path / "run")]
    process = subprocess.Popen(
        [*program, "--redis", shared_redis.url, *options],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={name: value for name, value in os.environ.items() if name != REDIS_VARIABLE},
    )
    try:
        place = Path(f"/proc/{process.pid}")
        deadline = time.monotonic() + 60
        while password.encode() in (words := (place / "cmdline").read_bytes()) or not words:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        assert options[-1].encode() in words.split(b"\0")
        assert f"{REDIS_VARIABLE}={shared_redis.url}".encode() in (place / "environ").read_bytes().split(
            b"\0"
        )
    finally:
        process.terminate()
        process.wait(30)
