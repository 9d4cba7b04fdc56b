"""What each user of Redis can do and cannot, against a real server that is started as in deployments."""

import os
import subprocess
from pathlib import Path

import pytest
import redis
from bus_setup import Run, deliver, gather, some_document, some_metrics, toy_snapshot
from redis.backoff import NoBackoff
from redis.retry import Retry
from role_redis import DEPLOY, RoleRedis, role_redis, server_program
from tls import make_certificates

from taskschema.bus.connection import connect
from taskschema.bus.keys import RUNS, RunKeys
from taskschema.bus.records import RunRecords
from taskschema.bus.worker_bus import WorkerBus
from taskschema.config import RunConfig
from taskschema.errors import BusError
from taskschema_learner.api.exposition import exposition
from taskschema_learner.api.redis_source import RedisSource

KEYS = RunKeys("some-run")
DENIED_TO_ALL = [
    ("EVAL", "return 1", "0"),
    ("EVALSHA", "0" * 40, "0"),
    ("SCRIPT", "LOAD", "return 1"),
    ("CONFIG", "GET", "*"),
    ("CONFIG", "SET", "dir", "/tmp"),
    ("FLUSHALL",),
    ("FLUSHDB",),
    ("KEYS", "*"),
    ("SCAN", "0"),
    ("SHUTDOWN", "NOSAVE"),
    ("DEBUG", "SLEEP", "0"),
    ("ACL", "LIST"),
    ("ACL", "SETUSER", "intruder", "on", "nopass", "+@all", "~*"),
    ("MODULE", "LIST"),
    ("REPLICAOF", "192.0.2.1", "6379"),
    ("MIGRATE", "192.0.2.1", "6379", "key", "0", "1"),
    ("CLIENT", "KILL", "TYPE", "normal"),
    ("CLIENT", "LIST"),
    ("MONITOR",),
    ("SAVE",),
    ("BGREWRITEAOF",),
    ("RENAME", KEYS.fence, KEYS.work),
    ("DUMP", KEYS.policy),
    ("RESTORE", KEYS.policy, "0", "x"),
    ("PUBLISH", "channel", "message"),
    ("SET", "somebody-elses-key", "value"),
    ("GET", "somebody-elses-key"),
]
DENIED_TO_AGENTS = [
    ("XDEL", KEYS.work, "1-0"),
    ("XTRIM", KEYS.trajectories, "MAXLEN", "0"),
    ("XREAD", "STREAMS", KEYS.trajectories, "0"),
    ("XRANGE", KEYS.trajectories, "-", "+"),
    ("DEL", KEYS.work),
    ("GET", KEYS.fence),
    ("INCR", KEYS.fence),
    ("SET", KEYS.fence, "7"),
    ("SET", KEYS.agent_kind, "robot"),
    ("SETNX", KEYS.fence, "7"),
    ("HSET", KEYS.schemas, "current", "{}"),
    ("XADD", KEYS.curve, "*", "row", "{}"),
    ("XADD", KEYS.quarantine, "*", "kind", "x"),
    ("HSET", KEYS.quarantine_counts, "malformed", "0"),
    ("HDEL", KEYS.refusals, "0:0"),
    ("SET", KEYS.request, "stop"),
    ("SET", KEYS.target, "0"),
    ("SADD", RUNS, "another"),
    ("XGROUP", "DESTROY", KEYS.work, "agents"),
    ("XGROUP", "DELCONSUMER", KEYS.work, "agents", "another"),
    ("XGROUP", "SETID", KEYS.work, "agents", "$"),
]
READ_ONLY_TO_AGENTS = [
    ("HSET", KEYS.status, "state", "finished"),
    ("HSET", KEYS.policy, "version", "99"),
    ("HSET", KEYS.config, "hash", "0"),
    ("HDEL", KEYS.policy, "data"),
]
NOT_APPENDED_TO_BY_AGENTS = [
    ("XADD", KEYS.work, "*", "item", "forged"),
    ("XADD", KEYS.work, "MAXLEN", "0", "*", "item", "forged"),
    ("XADD", KEYS.work, "MINID", "99999999999999", "*", "item", "forged"),
]
"""Work that nobody offered, and the loss of what is offered: they append to the trajectories alone."""
DENIED_TO_API = [
    ("XADD", KEYS.work, "*", "item", "{}"),
    ("XADD", KEYS.trajectories, "*", "header", "{}"),
    ("XDEL", KEYS.work, "1-0"),
    ("XRANGE", KEYS.work, "-", "+"),
    ("HSET", KEYS.policy, "version", "99"),
    ("INCR", KEYS.fence),
    ("SADD", RUNS, "another"),
]
READ_ONLY_TO_API = [("SET", KEYS.fence, "7"), ("DEL", KEYS.policy), ("SET", RUNS, "")]


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with role_redis(tmp_path_factory.mktemp("roles")) as running:
        yield running


def check_denied(client: redis.Redis, words: tuple[str, ...]) -> None:
    with pytest.raises(redis.ResponseError, match=r"permission|command not allowed"):
        client.execute_command(*words)


@pytest.mark.parametrize("role", ["learner", "worker", "api", "robot"])
@pytest.mark.parametrize("words", DENIED_TO_ALL, ids=" ".join)
def test_nobody_may(server: RoleRedis, role: str, words: tuple[str, ...]) -> None:
    check_denied(server.client(role), words)


@pytest.mark.parametrize("role", ["worker", "robot"])
@pytest.mark.parametrize("words", DENIED_TO_AGENTS, ids=" ".join)
def test_agents_may_not(server: RoleRedis, role: str, words: tuple[str, ...]) -> None:
    check_denied(server.client(role), words)


@pytest.mark.parametrize("role", ["worker", "robot"])
@pytest.mark.parametrize("words", [*READ_ONLY_TO_AGENTS, *NOT_APPENDED_TO_BY_AGENTS], ids=" ".join)
def test_agents_only_read(server: RoleRedis, role: str, words: tuple[str, ...]) -> None:
    needs_version_7(server)
    check_denied(server.client(role), words)


def test_a_robot_sees_what_its_run_is_doing(server: RoleRedis) -> None:
    """Its watchdog stops the arms when the learner fails or is silent; the policy version trims its log."""
    RunRecords(server.client("learner")).set_progress("run", round_index=3, version=3)
    with Run(server.url("learner"), RunConfig(task="toy")) as run:
        run.learner().beat()
        assert RunRecords(server.client("robot")).status(run.name).alive_at
    assert RunRecords(server.client("robot")).status("run").version == 3
    with pytest.raises(redis.ResponseError, match=r"permission|command not allowed"):
        server.client("worker").hgetall(RunKeys("run").status)


@pytest.mark.parametrize("words", DENIED_TO_API, ids=" ".join)
def test_the_api_may_not(server: RoleRedis, words: tuple[str, ...]) -> None:
    check_denied(server.client("api"), words)


@pytest.mark.parametrize("words", READ_ONLY_TO_API, ids=" ".join)
def test_the_api_only_reads(server: RoleRedis, words: tuple[str, ...]) -> None:
    needs_version_7(server)
    check_denied(server.client("api"), words)


def needs_version_7(server: RoleRedis) -> None:
    if not server.protects_keys:
        pytest.skip("needs a redis-server of 7.0 or newer on the path: 6.2 knows no read-only keys")


@pytest.mark.parametrize(
    ("user", "password"), [(None, None), ("default", ""), ("worker", "wrong"), ("nobody", "x")]
)
def test_nobody_else_comes_in(server: RoleRedis, user: str | None, password: str | None) -> None:
    stranger = redis.Redis(port=server.port, username=user, password=password, retry=Retry(NoBackoff(), 0))
    with pytest.raises(redis.AuthenticationError):
        stranger.ping()


def test_tls_all_the_way(tmp_path: Path) -> None:
    """A round on a server that speaks nothing but TLS."""
    if not server_program()[1]:
        pytest.skip("needs a redis-server of 7.0 or newer on the path: the bundled one speaks no TLS")
    with (
        role_redis(tmp_path, make_certificates(tmp_path / "tls")) as server,
        Run(server.url("learner")) as run,
        WorkerBus(connect(server.url("worker")), run.name, "worker") as agent,
    ):
        learner = run.learner()
        learner.open_round(0, toy_snapshot(), range(8))
        deliver(agent)
        assert len(gather(learner, 8)) == 8
        with pytest.raises(BusError, match="does not answer"):
            connect(server.url("worker").replace("rediss", "redis").partition("?")[0])


def test_each_role_can_do_its_work(server: RoleRedis) -> None:
    """Rounds, refusals, leaving and requests, each part under its own user."""
    config = RunConfig(task="toy", slots=8)
    with Run(server.url("learner"), config) as run:
        learner, source = run.learner(), RedisSource.connect(server.url("api"))
        for role in ("worker", "robot"):
            with WorkerBus(connect(server.url(role)), run.name, role) as agent:
                learner.open_round(0, toy_snapshot(), range(8))
                assert len(agent.lease(1)) == 8
            with WorkerBus(connect(server.url(role)), run.name, f"{role}-2") as agent:
                assert deliver(agent) == list(range(8))
                assert len(gather(learner, 8)) == 8
                assert [worker.id for worker in source.workers(run.name)] == [f"{role}-2"]
            learner.trim(0)
        run.send(b"junk", b"junk")
        learner.results(0.5)
        learner.publish_update(toy_snapshot(1), some_document(run.name, 1), some_metrics(0))
        learner.restore_curve([some_metrics(1)])
        assert source.schema(run.name)
        assert source.policy(run.name).version == 1
        assert source.quarantine(run.name) == {"malformed": 1}
        assert b"taskschema_source_up 1.0" in exposition(source)
        for request in ("pause", "resume", "stop"):
            source.request(run.name, request)
        source.set_worker_target(run.name, 3)
        source.set_worker_target(run.name, None)
        assert run.records.stop_requested(run.name)
        assert source.curve(run.name)
        assert source.events(run.name, source.last_event(run.name)) == []


def test_what_was_answered_is_there_after_a_restart(tmp_path: Path) -> None:
    """Transactions too, of which a Redis whose default user may do nothing reads none again."""
    item = b"an item"
    for start in range(2):
        with role_redis(tmp_path) as server:
            client = server.client("learner")
            if start == 0:
                client.pipeline(transaction=True).hset(KEYS.config, "hash", item).set(KEYS.fence, 7).execute()
                client.hset(KEYS.policy, "version", 3)
            assert client.hget(KEYS.config, "hash") == item
            assert client.get(KEYS.fence) == b"7"
            assert client.hget(KEYS.policy, "version") == b"3"


def test_a_missing_password_is_one_clear_line() -> None:
    environment = {**os.environ, "REDIS_LEARNER_PASSWORD": "x", "REDIS_WORKER_PASSWORD": ""}
    done = subprocess.run([DEPLOY / "start.sh"], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (
        1,
        "Set REDIS_WORKER_PASSWORD: every role of Redis has its own.\n",
    )


def test_passwords_stand_nowhere_in_clear(server: RoleRedis, tmp_path: Path) -> None:
    with role_redis(tmp_path) as another:
        rules = (tmp_path / "users.acl").read_text()
        assert (tmp_path / "users.acl").stat().st_mode & 0o077 == 0
        commands = [path.read_bytes() for path in Path("/proc").glob("[0-9]*/cmdline") if path.exists()]
        for password in another.passwords.values():
            assert password not in rules + (tmp_path / "redis.log").read_text()
            assert not any(password.encode() in words for words in commands)
