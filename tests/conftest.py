"""What tests of several parts share: one Redis, and a fresh run on it for every test."""

from collections.abc import Iterator

import pytest
from bus_setup import Run

from taskschema_learner.embedded_redis import EmbeddedRedis


@pytest.fixture(scope="session")
def shared_redis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmbeddedRedis]:
    with EmbeddedRedis(tmp_path_factory.mktemp("shared-redis")) as server:
        yield server


@pytest.fixture
def run(shared_redis: EmbeddedRedis) -> Iterator[Run]:
    with Run(shared_redis.url) as fresh:
        yield fresh
