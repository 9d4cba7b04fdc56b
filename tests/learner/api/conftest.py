"""A Redis, and the API's process before it."""

import threading

import httpx
import pytest
import redis
from api_setup import RUN, TOKEN, Served, trained_run

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema_learner.api.process import ApiProcess
from taskschema_learner.api.rates import DEFAULTS
from taskschema_learner.embedded_redis import EmbeddedRedis


@pytest.fixture(scope="session")
def redis_url(tmp_path_factory):
    with EmbeddedRedis(tmp_path_factory.mktemp("redis")) as server:
        # A fresh run is written before every test: its writes need not survive a power cut.
        redis.Redis.from_url(server.url).config_set("appendfsync", "no")
        yield server.url


@pytest.fixture(scope="session")
def api_url(redis_url):
    limits = dict.fromkeys(DEFAULTS, "100000/second")  # tests come faster than people do
    with pytest.MonkeyPatch.context() as patch:
        for name, value in limits.items():
            patch.setenv(name, value)
        api = ApiProcess(redis_url, RUN, "127.0.0.1:0", token=TOKEN)
        api.__enter__()
    yield api.url
    api.__exit__(None, None, None)


@pytest.fixture(scope="session")
def clients(redis_url, api_url):
    bearer = {"Authorization": f"Bearer {TOKEN}"}
    with (
        httpx.Client(base_url=api_url, timeout=10) as http,
        httpx.Client(base_url=api_url, timeout=10, headers=bearer) as owner,
    ):
        yield Served(http, owner, RunRecords(connect(redis_url)))


def shows_version(http, version):
    schema, policy = http.get("/schema"), http.get("/policy")
    answered = schema.status_code == policy.status_code == 200
    return answered and schema.json()["version"] == version == int(policy.headers["policy-version"])


@pytest.fixture
def served(clients):
    for name in clients.records.runs():
        clients.records.delete_run(name)
    trained_run(clients.records, RUN)
    # What the test before left in the API's memory goes within a quarter of a second.
    while not shows_version(clients.http, 3):
        threading.Event().wait(0.02)
    return clients
