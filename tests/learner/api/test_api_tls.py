"""TLS of the API, with a throw-away certificate authority."""

import os
import ssl
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
from api_setup import RUN, TOKEN
from tls import make_certificates

from taskschema.bus.url import REDIS_VARIABLE
from taskschema.errors import ConfigError
from taskschema_learner.api.process import ApiProcess
from taskschema_learner.api.tokens import TOKEN_VARIABLE
from taskschema_learner.api.transport import Tls

COMMAND = str(Path(sys.executable).with_name("taskschema"))


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    return make_certificates(tmp_path_factory.mktemp("certificates"))


def test_the_api_behind_tls(redis_url, served, certificates):
    tls = Tls(certificates.certificate, certificates.key)
    with ApiProcess(redis_url, RUN, "127.0.0.1:0", token=TOKEN, tls=tls) as api:
        assert api.url.startswith("https://127.0.0.1:")
        trust = ssl.create_default_context(cafile=str(certificates.ca))
        with httpx.Client(verify=trust, base_url=api.url) as http:
            assert http.get("/schema").status_code == 200
            bearer = {"Authorization": f"Bearer {TOKEN}"}
            assert http.put("/workers", json={"target": None}, headers=bearer).status_code == 200
        with pytest.raises(httpx.ConnectError, match="CERTIFICATE_VERIFY_FAILED"):
            httpx.get(f"{api.url}/schema")
        old = ssl.create_default_context(cafile=str(certificates.ca))
        with pytest.warns(DeprecationWarning, match="TLSv1_1"):
            old.maximum_version = ssl.TLSVersion.TLSv1_1
        with pytest.raises(httpx.ConnectError):
            httpx.get(f"{api.url}/schema", verify=old)
        with pytest.raises(httpx.HTTPError):
            httpx.get(f"{api.url.replace('https', 'http')}/schema")


@pytest.mark.parametrize(
    ("words", "prefix"),
    [
        ([sys.executable, "-m", "taskschema_learner.api", "--port", "0"], "--tls"),
        ([COMMAND, "serve", RUN, "--api", "127.0.0.1:0"], "--api-tls"),
    ],
    ids=["the API's own command", "taskschema serve"],
)
def test_the_commands_speak_tls(redis_url, certificates, words, prefix):
    options = [f"{prefix}-cert", str(certificates.certificate), f"{prefix}-key", str(certificates.key)]
    process = subprocess.Popen(
        [*words, *options],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, REDIS_VARIABLE: redis_url, TOKEN_VARIABLE: TOKEN},
    )
    try:
        url = process.stdout.readline().split()[1]
        trust = ssl.create_default_context(cafile=str(certificates.ca))
        assert httpx.get(f"{url}/healthz", verify=trust).json() == {"status": "ok"}
    finally:
        process.terminate()
        process.wait(10)


def test_one_file_is_not_enough(certificates):
    with pytest.raises(ConfigError, match="--api-tls-cert and --api-tls-key"):
        Tls.of(certificates.certificate, None)
    assert Tls.of(None, None) is None


def test_files_that_do_not_fit_are_one_clear_line(certificates, tmp_path):
    other = make_certificates(tmp_path / "other")
    with pytest.raises(ConfigError, match="no certificate and its key"):
        Tls(certificates.certificate, other.key)
    with pytest.raises(ConfigError, match="cannot be read for TLS"):
        Tls(Path("/no/such/file"), certificates.key)
    with pytest.raises(ConfigError, match="no certificate and its key"):
        Tls(certificates.key, certificates.certificate)
