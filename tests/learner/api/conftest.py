"""A Redis, and the API's process before it."""

import httpx
import pytest
import redis
from api_setup import RUN, TOKEN, Served, trained_run

from taskschema.bus.connection import connect
from taskschema.bus.records import RunRecords
from taskschema_learner.api.process import ApiProcess
from taskschema_learner.embedded_redis import EmbeddedRedis


@pytest.fixture(scope="session")
def redis_url(tmp_path_factory):
    with EmbeddedRedis(tmp_path_factory.mktemp("redis")) as server:
        # A fresh run is written before every test: its writes need not survive a power cut.
        redis.Redis.from_url(server.url).config_set("appendfsync", "no")
        yield server.url


@pytest.fixture(scope="session")
def api_url(redis_url):
    with ApiProcess(redis_url, RUN, "127.0.0.1:0", token=TOKEN) as api:
        yield api.url


@pytest.fixture
def served(redis_url, api_url):
    records = RunRecords(connect(redis_url))
    for name in records.runs():
        records.delete_run(name)
    trained_run(records, RUN)
    bearer = {"Authorization": f"Bearer {TOKEN}"}
    with (
        httpx.Client(base_url=api_url, timeout=10) as http,
        httpx.Client(base_url=api_url, timeout=10, headers=bearer) as owner,
    ):
        yield Served(http, owner, records)
