"""An agent's end of the bus: lease slots, fetch their policy, deliver their trajectories."""

import math
import time
from collections import Counter
from collections.abc import Sequence
from types import TracebackType
from typing import Any

import msgspec
import redis

from taskschema.bus.admission import DATA, HEADER
from taskschema.bus.connection import LONGEST_BLOCK_MS, bus_errors
from taskschema.bus.counters import JOINED, LEASE, TAKEN_OVER, observe
from taskschema.bus.heartbeat import Heartbeat
from taskschema.bus.keys import GROUP, RunKeys
from taskschema.bus.lease import Lease
from taskschema.bus.messages import SlotHeader
from taskschema.bus.records import RunRecords
from taskschema.bus.work_stream import (
    HANDED_BACK,
    HANDED_BACK_IDLE_MS,
    MOST_PENDING,
    ensure_group,
    open_count,
    read_item,
)
from taskschema.bus.worker_info import ALIVE_SECONDS, AgentKind
from taskschema.config import PROTOCOL_VERSION, RunConfig
from taskschema.errors import BusError, ConfigError
from taskschema.policies import PolicySnapshot
from taskschema.trajectory import Trajectory, encode_slot

LEASE_SECONDS = 15.0
"""A simulated worker that gave no sign of life for this long [s] loses its leases to another."""
MOST_SLOTS = 25
"""Slots leased at once at most: bounds the memory of the batch they are run as; larger ones are no faster."""
MOST_SHARED_SLOTS = 8
"""As many for agents that share their core with others, and its memory."""
SHORTEST_BLOCK_MS = 100
"""An idle agent asks this often whether others' leases have expired [ms], as long as some are held."""
MS_PER_AGENT = 20
"""The more agents, the less often each one asks: all together once in so many milliseconds."""
SLOTS_PER_TRANSACTION = 16
"""Bounds the memory of one delivery."""


class WorkerBus:
    """Leases slots of one run to one agent. A context manager: joins the run and leaves it.

    All methods raise BusError when Redis does not answer; the agent may then just try again.

    Args:
        client: connection to the run's Redis.
        run: the run's name.
        worker_id: the agent's name, unique within the run.
        kind: simulated worker or robot.
        lease_seconds: an agent that gave no sign of life for this long [s] loses its leases.
        cores: part of a core that the agent has to itself.

    """

    def __init__(
        self,
        client: redis.Redis,
        run: str,
        worker_id: str,
        *,
        kind: AgentKind = "simulation",
        lease_seconds: float = LEASE_SECONDS,
        cores: float = 1.0,
    ) -> None:
        self._client: Any = client  # redis-py types every answer as a union with its asyncio twin's
        self._run = run
        self._worker_id = worker_id
        self._kind = kind
        self._lease_ms = int(lease_seconds * 1000)
        self._cores = min(cores, 1.0)
        self._keys = RunKeys(run)
        self._records = RunRecords(client)
        self._config: RunConfig | None = None
        self._heartbeat: Heartbeat | None = None
        self._held: dict[bytes, float] = {}  # when each entry was leased [s]
        self._snapshot: PolicySnapshot | None = None

    def __enter__(self) -> "WorkerBus":
        self.join()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.leave()

    @property
    def worker_id(self) -> str:
        """The agent's name, unique within the run."""
        return self._worker_id

    @bus_errors()
    def join(self) -> RunConfig:
        """Say that the agent is there, and return the run's config; once joined, only the latter.

        What an agent of the same name had leased and did not deliver is there for everybody again.

        Raises:
            UnknownNameError: if there is no such run.
            ConfigError: if the run speaks another protocol, or is served by another kind of agent.

        """
        if self._config is None:
            config = self._records.config(self._run)
            self._compare(config)
            ensure_group(self._client, self._keys)
            # Of an agent of this name that was killed: a robot's would wait for hours until they expire.
            self._hand_back(self._left_behind())
            heartbeat = Heartbeat(self._client, self._keys, self._worker_id, self._kind)
            heartbeat.start()
            self._heartbeat, self._config = heartbeat, config
        return self._config

    def _compare(self, config: RunConfig) -> None:
        with self._client.pipeline(transaction=True) as pipe:
            pipe.hmget(self._keys.config, "protocol", "hash")
            pipe.setnx(self._keys.agent_kind, self._kind)
            pipe.get(self._keys.agent_kind)
            pipe.hincrby(self._keys.leases, JOINED, 1)
            (protocol, config_hash), _, kind, _ = pipe.execute()
        if int(protocol) != PROTOCOL_VERSION or config_hash.decode() != config.config_hash:
            raise self._of_another_version(protocol)
        if kind.decode() != self._kind:
            raise ConfigError(
                f"Run {self._run!r} is served by {kind.decode()} agents, this is a {self._kind} one: "
                "the two never share a run."
            )

    def _of_another_version(self, protocol: bytes) -> ConfigError:
        return ConfigError(
            f"Run {self._run!r} is trained by another version of taskschema (protocol {int(protocol)}, "
            f"here {PROTOCOL_VERSION}): install the same one here."
        )

    @bus_errors()
    def leave(self) -> None:
        """Hand back what is leased and go."""
        if self._heartbeat is None:
            return
        heartbeat, self._heartbeat, self._config = self._heartbeat, None, None
        held, self._held = list(self._held), {}
        heartbeat.stop()  # first: a beat would renew what is handed back
        self._hand_back(held)

    def _left_behind(self) -> list[bytes]:
        """Return what is leased under this agent's name."""
        streams = self._client.xreadgroup(GROUP, self._worker_id, {self._keys.work: "0"}, count=MOST_PENDING)
        return [entry_id for _, entries in streams for entry_id, _ in entries]

    def _hand_back(self, entry_ids: list[bytes]) -> None:
        if entry_ids:
            idle = HANDED_BACK_IDLE_MS
            self._client.xclaim(self._keys.work, GROUP, HANDED_BACK, 0, entry_ids, idle=idle, justid=True)

    @bus_errors()
    def lease(self, block_ms: int) -> list[Lease]:
        """Return slots to run, all with the same policy; waits up to `block_ms` [ms, at most 10 s].

        Expired leases of others come first. No more than the agent's share, ceil(open slots / cores of all
        live agents), so that all finish at about the same time: agents that share a core run after one
        another, and a batch of one slot costs more an episode than one of eight. Never more than
        `MOST_SLOTS`, or `MOST_SHARED_SLOTS`.

        Raises:
            ConfigError: if the run was replaced by one of another config, or speaks another protocol now.

        """
        share, patience_ms = self._share()
        entries = self._expired(share)
        if not entries:
            entries = self._offered(share, max(1, min(block_ms, patience_ms)))
        leases, worthless = self._sort(entries)
        if worthless:
            self._client.xack(self._keys.work, GROUP, *worthless)
        self._held.update(dict.fromkeys((lease.entry_id for lease in leases), time.monotonic()))
        self._beating.hold([lease.entry_id for lease in leases])
        return leases

    @property
    def _beating(self) -> Heartbeat:
        if self._heartbeat is None:
            raise BusError(f"Agent {self._worker_id!r} has not joined run {self._run!r}: join it first.")
        return self._heartbeat

    def _share(self) -> tuple[int, int]:
        """Return how many slots to take at most, and how long to wait for them before asking again [ms]."""
        config = self.join()
        with self._client.pipeline(transaction=False) as pipe:
            pipe.hmget(self._keys.config, "protocol", "hash")
            pipe.time()
            (protocol, config_hash), (seconds, _) = pipe.execute()
        if config_hash is None or config_hash.decode() != config.config_hash:
            raise ConfigError(f"Run {self._run!r} is gone or has another config now: start the agent again.")
        if int(protocol) != PROTOCOL_VERSION:
            raise self._of_another_version(protocol)
        # Counted by the server: thousands of workers must not read each other's names.
        alive: int = self._client.zcount(self._keys.heartbeats, f"({seconds - ALIVE_SECONDS}", "+inf")
        open_slots = open_count(self._client, self._keys)
        # An idle agent waits for the next round, whose slots come all at once, or for leases to expire.
        patience_ms = max(SHORTEST_BLOCK_MS, alive * MS_PER_AGENT) if open_slots else LONGEST_BLOCK_MS
        most = MOST_SLOTS if self._cores == 1.0 else MOST_SHARED_SLOTS
        share = math.ceil((open_slots or config.slots) / max(alive * self._cores, 1.0))
        return min(share, most), min(patience_ms, LONGEST_BLOCK_MS)

    def _expired(self, count: int) -> list[tuple[bytes, dict[bytes, bytes]]]:
        try:
            claimed = self._client.xautoclaim(
                self._keys.work, GROUP, self._worker_id, self._lease_ms, "0-0", count=count
            )
        except redis.ResponseError as error:
            if not str(error).startswith("NOGROUP"):
                raise
            ensure_group(self._client, self._keys)  # Redis was emptied; the learner offers its slots again
            return []
        entries = [(entry_id, fields) for entry_id, fields in claimed[1] if entry_id is not None]
        if entries:
            self._client.hincrby(self._keys.leases, TAKEN_OVER, len(entries))
        return entries

    def _offered(self, count: int, block_ms: int) -> list[tuple[bytes, dict[bytes, bytes]]]:
        streams = self._client.xreadgroup(
            GROUP, self._worker_id, {self._keys.work: ">"}, count=count, block=block_ms
        )
        return [entry for _, entries in streams for entry in entries]

    def _sort(self, entries: Sequence[tuple[bytes, dict[bytes, bytes]]]) -> tuple[list[Lease], list[bytes]]:
        """Part what the newest policy is asked to run from what a round before left behind."""
        leases, worthless = [], []
        for entry_id, fields in entries:
            item = read_item(fields)
            if item is not None and self._is_newest(item.policy_sha256):
                leases.append(Lease(entry_id, item))
            else:
                worthless.append(entry_id)
        return leases, worthless

    def _is_newest(self, sha256: str) -> bool:
        if self._snapshot is None or self._snapshot.sha256 != sha256:
            published = self._records.policy(self._run)
            if published is None or published.sha256 != sha256:
                return False
            self._snapshot = PolicySnapshot.from_bytes(published.data)
        return self._snapshot.sha256 == sha256

    def policy(self, lease: Lease) -> PolicySnapshot:
        """Return the policy to run a lease just taken with."""
        assert self._snapshot is not None
        assert self._snapshot.sha256 == lease.item.policy_sha256
        return self._snapshot

    @bus_errors()
    def submit(self, results: list[tuple[Lease, list[Trajectory]]]) -> None:
        """Deliver slots: push their trajectories and end their leases in one step.

        What is delivered is taken out of `results`, so that the rest can be tried again.
        """
        while results:
            part = results[:SLOTS_PER_TRANSACTION]
            with self._client.pipeline(transaction=True) as pipe:
                for lease, trajectories in part:
                    entry = {HEADER: self._header(lease), DATA: encode_slot(trajectories)}
                    pipe.xadd(self._keys.trajectories, entry)
                    pipe.xack(self._keys.work, GROUP, lease.entry_id)
                for leased_at, count in Counter(self._held.get(lease.entry_id) for lease, _ in part).items():
                    if leased_at is not None:
                        observe(pipe, self._keys.leases, LEASE, time.monotonic() - leased_at, count)
                pipe.execute()
            del results[:SLOTS_PER_TRANSACTION]
            self._release([lease for lease, _ in part], sum(len(trajectories) for _, trajectories in part))

    @bus_errors()
    def refuse(self, slots: list[tuple[Lease, str]]) -> None:
        """Say for slots what is wrong with the camera's frame, and end their leases.

        The learner offers them again, and stops the run at the third time. What is said is taken out of
        `slots`, so that the rest can be tried again.
        """
        while slots:
            lease, bad_frame = slots[0]
            with self._client.pipeline(transaction=True) as pipe:
                pipe.xadd(self._keys.trajectories, {HEADER: self._header(lease, bad_frame), DATA: b""})
                pipe.xack(self._keys.work, GROUP, lease.entry_id)
                pipe.execute()
            del slots[0]
            self._release([lease], episodes=0)

    def _release(self, leases: list[Lease], episodes: int) -> None:
        """Forget leases that are over, for which so many episodes were delivered."""
        for lease in leases:
            self._held.pop(lease.entry_id, None)
        self._beating.release([lease.entry_id for lease in leases], episodes)

    def _header(self, lease: Lease, bad_frame: str = "") -> bytes:
        header = SlotHeader(
            protocol=PROTOCOL_VERSION,
            config_hash=self.join().config_hash,
            round=lease.item.round,
            slot=lease.item.slot,
            policy_sha256=lease.item.policy_sha256,
            worker=self._worker_id,
            bad_frame=bad_frame,
        )
        return msgspec.json.encode(header)
