"""What tests of several parts share: one Redis, and a fresh run on it for every test."""

import os
from collections.abc import Iterator

import pytest
from bus_setup import Run
from hypothesis import HealthCheck, settings

from taskschema_learner.embedded_redis import EmbeddedRedis

# MuJoCo reads this once, when a test first imports it; pictures are drawn off screen.
os.environ.setdefault("MUJOCO_GL", "egl")
# How long an example takes depends on the machine's other work: never a reason to fail.
settings.register_profile("taskschema", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("taskschema")


@pytest.fixture(scope="session")
def shared_redis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmbeddedRedis]:
    with EmbeddedRedis(tmp_path_factory.mktemp("shared-redis")) as server:
        yield server


@pytest.fixture
def run(shared_redis: EmbeddedRedis) -> Iterator[Run]:
    with Run(shared_redis.url) as fresh:
        yield fresh
