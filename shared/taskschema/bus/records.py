"""The facts about runs that everybody may read: they outlive the learner."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Literal, NamedTuple

import msgspec
import redis

from taskschema.bus.connection import LONGEST_BLOCK_MS, bus_errors
from taskschema.bus.counters import RunCounters, observe_round, read_counters
from taskschema.bus.keys import RUNS, RunKeys
from taskschema.bus.run_status import RunState, RunStatus
from taskschema.bus.worker_info import ALIVE_SECONDS, WorkerInfo
from taskschema.config import PROTOCOL_VERSION, RunConfig, parse_config
from taskschema.errors import BusError, UnknownNameError
from taskschema.metrics import RoundMetrics
from taskschema.policies import PolicySnapshot
from taskschema.schema import SchemaDocument

__all__ = ["FIRST_EVENT", "PublishedPolicy", "RunRecords", "RunStatus", "WorkerInfo"]

KEEP_SCHEMAS = 2_000
"""Schema documents of older versions go."""
FIRST_EVENT = "0-0"
"""The place before every event."""

Request = Literal["pause", "resume", "stop"]


class PublishedPolicy(NamedTuple):
    """The newest policy of a run."""

    version: int
    sha256: str
    data: bytes
    """safetensors, as `PolicySnapshot.to_bytes` makes them."""


class RunRecords:
    """Facts about runs in Redis: written by the learner, read by API, command and agents.

    Methods that only write also work on a pipeline, so that the learner makes them part of a transaction.
    Methods that read raise UnknownNameError for a run that is not registered where they need its config,
    and all raise BusError when Redis does not answer.
    """

    def __init__(self, client: redis.Redis) -> None:
        self._client: Any = client  # redis-py types every answer as a union with its asyncio twin's

    @bus_errors()
    def ping(self) -> None:
        """Return if Redis answers."""
        self._client.ping()

    @bus_errors()
    def register_run(self, run: str, config: RunConfig) -> None:
        """Make a run known, or find it known with the same config.

        Raises:
            BusError: if a run of this name has another config.
            ConfigError: if the name cannot be used.

        """
        keys = RunKeys(run)
        facts = {
            "config": msgspec.json.encode(config),
            "hash": config.config_hash,
            "protocol": PROTOCOL_VERSION,
        }
        with self._client.pipeline(transaction=True) as pipe:
            for name, value in facts.items():
                pipe.hsetnx(keys.config, name, value)
            pipe.hsetnx(keys.status, "started_at", _now())
            pipe.hget(keys.config, "hash")
            known = pipe.execute()[-1].decode()
        if known != config.config_hash:
            raise BusError(
                f"This Redis has a run {run!r} with another config: choose another name with --run-dir."
            )
        self._client.sadd(RUNS, run)

    @bus_errors()
    def delete_run(self, run: str) -> None:
        """Remove everything about a run."""
        self._client.delete(*RunKeys(run).all)
        self._client.srem(RUNS, run)

    @bus_errors()
    def runs(self) -> list[str]:
        """Return the names of all runs, sorted."""
        return sorted(name.decode() for name in self._client.smembers(RUNS))

    @bus_errors()
    def config(self, run: str) -> RunConfig:
        """Return a run's config.

        Raises:
            UnknownNameError: if there is no such run.
            ConfigError: if it was written by another version of taskschema.

        """
        data = self._client.hget(RunKeys(run).config, "config")
        if data is None:
            raise UnknownNameError("run", run, self.runs())
        return parse_config(data)

    # Schema, policy and curve

    @bus_errors()
    def write_schema(self, document: SchemaDocument) -> None:
        """Publish a schema as the current one and under its version."""
        key = RunKeys(document.run).schemas
        data = msgspec.json.encode(document)
        self._client.hset(key, mapping={"current": data, str(document.version): data})
        self._client.hdel(key, str(document.version - KEEP_SCHEMAS))

    @bus_errors()
    def schema(self, run: str, version: int | None = None) -> bytes | None:
        """Return a SchemaDocument as JSON: the current one, or of a version; None if there is none."""
        name = "current" if version is None else str(version)
        data: bytes | None = self._client.hget(RunKeys(run).schemas, name)
        return data

    @bus_errors()
    def schema_versions(self, run: str) -> list[int]:
        """Return the versions whose schemas are kept, ascending."""
        return sorted(int(name) for name in self._client.hkeys(RunKeys(run).schemas) if name != b"current")

    @bus_errors()
    def write_policy(self, run: str, snapshot: PolicySnapshot) -> None:
        """Publish a policy as the newest one."""
        facts = {"version": snapshot.version, "sha256": snapshot.sha256, "data": snapshot.to_bytes()}
        self._client.hset(RunKeys(run).policy, mapping=facts)

    @bus_errors()
    def policy(self, run: str) -> PublishedPolicy | None:
        """Return the newest policy; None if there is none yet."""
        version, sha256, data = self._client.hmget(RunKeys(run).policy, "version", "sha256", "data")
        return None if data is None else PublishedPolicy(int(version), sha256.decode(), data)

    @bus_errors()
    def write_metrics(self, run: str, row: RoundMetrics) -> None:
        """Append a round to the curve, once: its place is its policy version; and count what it adds."""
        self._client.xadd(RunKeys(run).curve, {"row": msgspec.json.encode(row)}, id=f"{row.policy_version}-0")
        observe_round(self._client, RunKeys(run).counters, row)

    @bus_errors()
    def curve(self, run: str, since: int = 0) -> list[RoundMetrics]:
        """Return the rows of all rounds from `since` on, oldest first."""
        return [_row(fields) for _, fields in self._client.xrange(RunKeys(run).curve, min=f"{since + 1}-0")]

    @bus_errors()
    def latest(self, run: str) -> RoundMetrics | None:
        """Return the row of the newest round, if there is one."""
        entries = self._client.xrevrange(RunKeys(run).curve, count=1)
        return _row(entries[0][1]) if entries else None

    @bus_errors()
    def last_event(self, run: str) -> str:
        """Return the place of the newest event, `FIRST_EVENT` if there is none."""
        entries = self._client.xrevrange(RunKeys(run).curve, count=1)
        return entries[0][0].decode() if entries else FIRST_EVENT

    @bus_errors()
    def events(
        self, run: str, last_id: str = FIRST_EVENT, block_ms: int | None = None
    ) -> list[tuple[str, RoundMetrics]]:
        """Return (place, row) of the rounds published after a place.

        Waits up to `block_ms` [ms, at most 10 s] for the first one; None: not at all.
        """
        block = None if block_ms is None else max(1, min(block_ms, LONGEST_BLOCK_MS))
        streams = self._client.xread({RunKeys(run).curve: last_id}, block=block)
        return [(place.decode(), _row(fields)) for _, entries in streams for place, fields in entries]

    # Status and requests

    @bus_errors()
    def set_state(self, run: str, state: RunState, message: str = "") -> None:
        """Say what the run is doing."""
        self._write_status(run, {"state": state, "message": message})

    @bus_errors()
    def set_progress(self, run: str, *, round_index: int, version: int) -> None:
        """Say which round is being collected, on which policy version."""
        self._write_status(run, {"round": round_index, "version": version})

    @bus_errors()
    def set_api(self, run: str, url: str | None) -> None:
        """Say where the HTTP API of the run's own command answers; None: nowhere."""
        self._write_status(run, {"api": url or ""})

    @bus_errors()
    def set_alive(self, run: str) -> None:
        """Say that the learner is there; nothing else about the run has changed."""
        now = datetime.now(UTC).isoformat(timespec="microseconds")
        self._client.hset(RunKeys(run).status, "alive_at", now)

    def _write_status(self, run: str, fields: Mapping[str, str | int]) -> None:
        self._client.hset(RunKeys(run).status, mapping={**fields, "updated_at": _now()})

    @bus_errors()
    def status(self, run: str) -> RunStatus:
        """Return what a run is doing."""
        stored = self._client.hgetall(RunKeys(run).status)
        fields = {name.decode(): value.decode() for name, value in stored.items()}
        fields["api"] = fields.get("api") or None
        return msgspec.convert({**fields, "run": run}, RunStatus, strict=False)

    @bus_errors()
    def request(self, run: str, request: Request) -> None:
        """Ask the learner to pause, to go on, or to stop; it looks several times a second."""
        if request == "resume":
            self._client.delete(RunKeys(run).request)
        else:
            self._client.set(RunKeys(run).request, request)

    @bus_errors()
    def pause_requested(self, run: str) -> bool:
        """Return whether the run is to pause."""
        return bool(self._client.get(RunKeys(run).request) == b"pause")

    @bus_errors()
    def stop_requested(self, run: str) -> bool:
        """Return whether the run is to stop."""
        return bool(self._client.get(RunKeys(run).request) == b"stop")

    @bus_errors()
    def clear_requests(self, run: str) -> None:
        """Forget what was asked, as it was obeyed."""
        self._client.delete(RunKeys(run).request)

    # Workers and quarantine

    @bus_errors()
    def workers(self, run: str) -> list[WorkerInfo]:
        """Return the agents that are alive, sorted by their names."""
        keys = RunKeys(run)
        now = _seconds(self._client.time())
        seen = dict(self._client.zrangebyscore(keys.heartbeats, now - ALIVE_SECONDS, "+inf", withscores=True))
        stored = self._client.hmget(keys.workers, *sorted(seen)) if seen else []
        alive = [msgspec.json.decode(data, type=WorkerInfo) for data in stored if data is not None]
        return [
            msgspec.structs.replace(info, last_seen=max(0.0, now - seen[info.id.encode()])) for info in alive
        ]

    @bus_errors()
    def worker_target(self, run: str) -> int | None:
        """Return how many workers somebody asked for; None: as many as there is capacity for."""
        target = self._client.get(RunKeys(run).target)
        return None if target is None else int(target)

    @bus_errors()
    def set_worker_target(self, run: str, target: int | None) -> None:
        """Ask for a number of workers; None: as many as there is capacity for."""
        if target is None:
            self._client.delete(RunKeys(run).target)
        else:
            self._client.set(RunKeys(run).target, target)

    @bus_errors()
    def quarantine_counts(self, run: str) -> dict[str, int]:
        """Return how many messages were refused so far, by kind of reason."""
        counts = self._client.hgetall(RunKeys(run).quarantine_counts)
        return {kind.decode(): int(count) for kind, count in sorted(counts.items())}

    @bus_errors()
    def counters(self, run: str) -> RunCounters:
        """Return what was counted about a run."""
        keys = RunKeys(run)
        with self._client.pipeline(transaction=False) as pipe:
            pipe.hgetall(keys.counters)
            pipe.hgetall(keys.leases)
            pipe.get(keys.fence)
            return read_counters(*pipe.execute())


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _seconds(time: Sequence[int]) -> float:
    seconds, microseconds = time
    return seconds + microseconds / 1e6


def _row(fields: Mapping[bytes, bytes]) -> RoundMetrics:
    return msgspec.json.decode(fields[b"row"], type=RoundMetrics)
