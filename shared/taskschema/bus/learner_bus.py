"""The learner's end of the bus: one learner writes, exactly the slots of one round come in."""

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import msgspec
import redis

from taskschema.bus.admission import Admission, RefusedError, SlotResult
from taskschema.bus.connection import LONGEST_BLOCK_MS, bus_errors
from taskschema.bus.counters import LOST
from taskschema.bus.keys import GROUP, RunKeys
from taskschema.bus.messages import WorkItem
from taskschema.bus.quarantine import Quarantine
from taskschema.bus.records import RunRecords
from taskschema.bus.run_status import RunState
from taskschema.bus.work_stream import (
    ITEM,
    ensure_group,
    idle_consumers,
    next_ids,
    place,
    silent_agents,
    work_entries,
)
from taskschema.config import PROTOCOL_VERSION, RunConfig
from taskschema.errors import BusError, StaleTokenError
from taskschema.metrics import RoundMetrics
from taskschema.policies import PolicySnapshot
from taskschema.schema import SchemaDocument
from taskschema.tasks.registry import task_of
from taskschema.trajectory import TrajectoryFormat

QUIET_SECONDS = 5.0
"""After this long without a result [s] the learner looks whether an open slot got lost."""
READ_COUNT = 16
"""Entries read at once: bounds the memory that large messages take."""
START = b"0-0"
"""Id before all entries of a stream."""
FORGET_WORKERS_SECONDS = 60.0
"""What a dead worker said about itself goes after this long [s]."""

T = TypeVar("T")


class LearnerBus:
    """Opens rounds and takes in their results.

    Every write is a transaction that fails if a newer learner has taken a fencing token: whoever holds
    the older one can change nothing any more. All methods raise StaleTokenError then, and BusError when
    Redis does not answer.
    """

    def __init__(self, client: redis.Redis, run: str, config: RunConfig) -> None:
        self._client: Any = client  # redis-py types every answer as a union with its asyncio twin's
        self._run = run
        self._config = config
        self._keys = RunKeys(run)
        self._format = TrajectoryFormat.of(task_of(config), config)
        self._token = 0
        self._door = self._new_door(0, (), "")
        self._quarantine = Quarantine(self._fenced, self._keys)
        self._inherited = self._last_read = self._boundary = START
        self._ready: list[SlotResult] = []
        self._last_arrival = time.monotonic()

    @property
    def token(self) -> int:
        """The fencing token; 0 before `acquire`."""
        return self._token

    @property
    def missing(self) -> list[int]:
        """Slots of the open round that no result came in for, ascending."""
        return self._door.missing

    @property
    @bus_errors()
    def quarantined(self) -> int:
        """Messages refused so far in this run."""
        return sum(int(count) for count in self._client.hvals(self._keys.quarantine_counts))

    @bus_errors()
    def acquire(self) -> int:
        """Take a new fencing token, which turns every older learner of this run out, and return it.

        From then on the run speaks this learner's protocol: the one before may have been of another version.
        """
        with self._client.pipeline(transaction=True) as pipe:
            pipe.incr(self._keys.fence)
            pipe.hset(self._keys.config, "protocol", PROTOCOL_VERSION)
            self._token = int(pipe.execute()[0])
        ensure_group(self._client, self._keys)
        newest = self._client.xrevrange(self._keys.trajectories, count=1)
        self._inherited = newest[0][0] if newest else START
        self._last_read = self._boundary = START
        self._ready = []
        self._last_arrival = time.monotonic()
        return self._token

    @bus_errors()
    def verify_token(self) -> None:
        """Return if this learner still holds the newest token; to be asked before a checkpoint."""
        self._verify(self._client.get(self._keys.fence))

    def _verify(self, newest: bytes | None) -> None:
        if newest is None:
            raise BusError(f"Redis has lost run {self._run!r}: start it again with --resume.")
        if int(newest) != self._token:
            raise StaleTokenError(
                f"Another learner has taken over run {self._run!r} (its token is {int(newest)}, this one's "
                f"{self._token}): this one stops and changes nothing."
            )

    def _fenced(self, plan: Callable[[Any], T], *watched: str) -> T:
        """Run a transaction: `plan` reads, calls `multi`, and queues its writes; repeated if disturbed."""

        def checked(pipe: Any) -> T:  # noqa: ANN401 - a pipeline, which redis-py leaves untyped
            self._verify(pipe.get(self._keys.fence))
            return plan(pipe)

        result: T = self._client.transaction(checked, self._keys.fence, *watched, value_from_callable=True)
        return result

    # Rounds

    @bus_errors()
    def open_round(self, round_index: int, snapshot: PolicySnapshot, slots: Iterable[int]) -> None:
        """Publish the policy of a round and offer those of its slots whose results are not there yet."""
        self._boundary = self._last_read
        self._door = self._new_door(round_index, slots, snapshot.sha256)
        self._ready = []

        def publish(records: RunRecords) -> None:
            records.write_policy(self._run, snapshot)
            records.set_state(self._run, "running")
            records.set_progress(self._run, round_index=round_index, version=snapshot.version)

        while self._offer_missing(publish) is None:
            self._read(block_ms=None)
        self._last_arrival = time.monotonic()

    @bus_errors()
    def results(self, timeout: float) -> list[SlotResult]:
        """Return what came in for the open round; waits up to `timeout` [s, at most 10] for the first.

        Raises:
            QuarantineLimitError: if a slot was refused three times.

        """
        self.verify_token()
        if not self._ready:
            block_ms = min(int(timeout * 1000), LONGEST_BLOCK_MS) or None
            count, refusals = self._read(block_ms)
            now = time.monotonic()
            if count:
                self._last_arrival = now
            if refusals or (self.missing and now > self._last_arrival + QUIET_SECONDS):
                self._last_arrival = now
                self._offer_again(refusals)
        ready, self._ready = self._ready, []
        return ready

    @bus_errors()
    def trim(self, round_index: int) -> None:
        """Remove what a checkpoint after this round covers, and what is left of dead workers."""
        boundary = self._last_read if self._door.round <= round_index else self._boundary
        milliseconds, sequence = place(boundary)
        seconds, _ = self._client.time()
        dead = self._client.zrangebyscore(self._keys.heartbeats, "-inf", seconds - FORGET_WORKERS_SECONDS)
        entries = work_entries(self._client, self._keys)
        covered = [
            entry.entry_id for entry in entries if entry.item is None or entry.item.round <= round_index
        ]
        idle = idle_consumers(self._client, self._keys)

        def plan(pipe: Any) -> None:  # noqa: ANN401 - a pipeline, which redis-py leaves untyped
            pipe.multi()
            minid = f"{milliseconds}-{sequence + 1}"
            pipe.xtrim(self._keys.trajectories, minid=minid, approximate=False)
            self._withdraw(pipe, covered)
            pipe.delete(self._keys.refusals)
            if dead:
                pipe.hincrby(self._keys.counters, LOST, len(dead))
                pipe.zrem(self._keys.heartbeats, *dead)
                pipe.hdel(self._keys.workers, *dead)
            for consumer in idle:
                pipe.xgroup_delconsumer(self._keys.work, GROUP, consumer)

        self._fenced(plan)

    def _new_door(self, round_index: int, slots: Iterable[int], policy_sha256: str) -> Admission:
        return Admission(round_index, slots, policy_sha256, self._config.config_hash, self._format)

    def _read(self, block_ms: int | None) -> tuple[int, list[RefusedError]]:
        """Read a few entries; return how many, and why some of them were refused."""
        position = {self._keys.trajectories: self._last_read}
        streams = self._client.xread(position, count=READ_COUNT, block=block_ms)
        entries = [entry for _, found in streams for entry in found]
        refusals = []
        for entry_id, fields in entries:
            self._last_read = entry_id
            try:
                result = self._door.admit(fields, inherited=place(entry_id) <= place(self._inherited))
                if result is not None:
                    self._ready.append(result)
            except RefusedError as error:
                self._quarantine.put(entry_id, fields, error, self._door.round)
                refusals.append(error)
        return len(entries), refusals

    def _offer_again(self, refusals: list[RefusedError]) -> None:
        """Offer the slots that were lost, with the refused results or otherwise."""
        while (lost := self._offer_missing()) is None:
            refusals += self._read(block_ms=None)[1]
        known = {error.slot for error in refusals}
        reason = refusals[-1] if refusals else RefusedError("its result got lost", "lost")
        for slot in lost:
            if slot not in known:  # its result was refused for a header that did not even name it
                self._quarantine.charge(slot, reason, self._door.round)

    def _offer_missing(self, publish: Callable[[RunRecords], None] | None = None) -> list[int] | None:
        """Offer the missing slots that nobody is offered, withdraw what is not wanted; return the former.

        Does nothing and returns None while results are unread: one of them may be a missing slot's, whose
        offer went when it arrived.
        """
        sha256 = self._door.policy_sha256

        def plan(pipe: Any) -> list[int] | None:  # noqa: ANN401 - a pipeline, which redis-py leaves untyped
            missing = {WorkItem(self._door.round, slot, sha256) for slot in self._door.missing}
            unwanted: list[bytes] = []
            entries = work_entries(pipe, self._keys)
            agents = {entry.agent for entry in entries if entry.agent is not None}
            silent = silent_agents(pipe, self._keys, agents) if publish is not None else set()
            for entry in entries:
                if entry.is_open and entry.item in missing and entry.agent not in silent:
                    missing.discard(entry.item)
                else:
                    unwanted.append(entry.entry_id)
            if pipe.xrange(self._keys.trajectories, min=b"(" + self._last_read, count=1):
                return None
            items = sorted(missing, key=lambda item: item.slot)
            ids = next_ids(pipe, self._keys, len(items))
            pipe.multi()
            if publish is not None:
                publish(RunRecords(pipe))
            self._withdraw(pipe, unwanted)
            for item, entry_id in zip(items, ids, strict=True):
                pipe.xadd(self._keys.work, {ITEM: msgspec.json.encode(item)}, id=entry_id)
            return [item.slot for item in items]

        # A delivery shows in the stream of results; that it ends a lease does not show in the work stream.
        return self._fenced(plan, self._keys.work, self._keys.trajectories)

    def _withdraw(self, pipe: Any, entry_ids: list[bytes]) -> None:  # noqa: ANN401 - a pipeline
        if entry_ids:
            pipe.xack(self._keys.work, GROUP, *entry_ids)
            pipe.xdel(self._keys.work, *entry_ids)

    # What everybody may see

    @bus_errors()
    def set_state(self, state: RunState, message: str = "") -> None:
        """Say what the run is doing."""
        self._write(lambda records: records.set_state(self._run, state, message))

    @bus_errors()
    def beat(self) -> None:
        """Give a sign of life; from any thread."""

        def plan(pipe: Any) -> None:  # noqa: ANN401 - a pipeline, which redis-py leaves untyped
            pipe.multi()
            RunRecords(pipe).set_alive(self._run)

        self._fenced(plan)

    @bus_errors()
    def publish_update(
        self, snapshot: PolicySnapshot, document: SchemaDocument, metrics: RoundMetrics
    ) -> None:
        """Publish what a round led to, in one transaction; a row that is there already is left alone.

        Once the next round is open, its policy is there and status names it.
        """

        def write(records: RunRecords) -> None:
            records.write_schema(document)
            if self._door.round <= metrics.round:
                records.write_policy(self._run, snapshot)
                records.set_progress(self._run, round_index=metrics.round, version=snapshot.version)

        self._write(write, [metrics])

    @bus_errors()
    def restore_curve(self, rows: Sequence[RoundMetrics]) -> None:
        """Append those rows of the run's folder that Redis lacks: it may have lost them, or be a new one."""
        self._write(lambda records: None, rows)

    def _write(self, write: Callable[[RunRecords], None], rows: Sequence[RoundMetrics] = ()) -> None:
        def plan(pipe: Any) -> None:  # noqa: ANN401 - a pipeline, which redis-py leaves untyped
            newest = pipe.xrevrange(self._keys.curve, count=1)
            last_version = place(newest[0][0])[0] if newest else 0
            pipe.multi()
            records = RunRecords(pipe)
            write(records)
            for row in rows:
                if row.policy_version > last_version:
                    records.write_metrics(self._run, row)

        self._fenced(plan)
