"""The stream of slots to run, as learner and agents see it.

An entry is *open* while it is offered (beyond the group's last delivered one) or leased (pending), and
*done* once its lease was acknowledged. Agents only acknowledge; done entries stay until the learner removes
them, so that an agent needs no right to delete anything. Entry ids count the offers (1-0, 2-0, ...): how
many slots are open follows from two ids and a count, however long the stream is.
"""

from typing import Any, NamedTuple

import msgspec
import redis

from taskschema.bus.keys import GROUP, RunKeys
from taskschema.bus.messages import WorkItem
from taskschema.bus.worker_info import ALIVE_SECONDS

ITEM = b"item"
MOST_PENDING = 100_000
"""No round has more slots."""
HANDED_BACK = "handed-back"
"""Consumer that holds the leases of agents that left, until somebody else claims them."""
HANDED_BACK_IDLE_MS = 30 * 24 * 3_600_000
"""What is handed back looks idle for this long [ms], longer than any lease: it is claimed at once."""


def ensure_group(client: redis.Redis, keys: RunKeys) -> None:
    """Make the stream and its consumer group, if they are not there."""
    try:
        client.xgroup_create(keys.work, GROUP, id="0", mkstream=True)
    except redis.ResponseError as error:
        if not str(error).startswith("BUSYGROUP"):
            raise


def read_item(fields: dict[bytes, bytes] | None) -> WorkItem | None:
    """Return an entry's item; None if it is not a valid one."""
    try:
        return msgspec.json.decode((fields or {}).get(ITEM, b""), type=WorkItem)
    except (msgspec.MsgspecError, UnicodeDecodeError):
        return None


def place(entry_id: bytes) -> tuple[int, int]:
    """Return a stream entry's id in the order of the stream."""
    first, second = entry_id.split(b"-")
    return int(first), int(second)


class WorkEntry(NamedTuple):
    """One entry of the stream."""

    entry_id: bytes
    item: WorkItem | None
    """None: what stands there is no valid one."""
    is_open: bool
    """Whether it is offered or leased; else it is done."""
    agent: bytes | None
    """Who leased it, if somebody does."""


def work_entries(client: Any, keys: RunKeys) -> list[WorkEntry]:  # noqa: ANN401 - or a pipeline
    """Return every entry, the done ones included, in order.

    What is leased between the looks counts as offered. What is acknowledged meanwhile may count as open: a
    caller that must know watches the stream of results, where its result arrives at the same moment.
    """
    group = next(group for group in client.xinfo_groups(keys.work) if group["name"] == GROUP.encode())
    last_leased = place(group["last-delivered-id"])
    pending = client.xpending_range(keys.work, GROUP, min="-", max="+", count=MOST_PENDING)
    agents = {entry["message_id"]: entry["consumer"] for entry in pending}
    return [
        WorkEntry(
            entry_id,
            read_item(fields),
            is_open=entry_id in agents or place(entry_id) > last_leased,
            agent=agents.get(entry_id),
        )
        for entry_id, fields in client.xrange(keys.work)
    ]


def next_ids(client: Any, keys: RunKeys, count: int) -> list[str]:  # noqa: ANN401 - or a pipeline
    """Return the ids of the next offers."""
    first = place(client.xinfo_stream(keys.work)["last-generated-id"])[0] + 1
    return [f"{first + number}-0" for number in range(count)]


def open_count(client: Any, keys: RunKeys) -> int:  # noqa: ANN401 - redis-py types every answer as a union
    """Return how many slots are offered or leased; 0 if there is no stream.

    Offers that the learner withdrew before anybody leased them count until the next one is leased.
    """
    try:
        with client.pipeline(transaction=False) as pipe:
            pipe.xinfo_stream(keys.work)
            pipe.xinfo_groups(keys.work)
            stream, groups = pipe.execute()
    except redis.ResponseError as error:
        if "no such key" not in str(error):
            raise
        return 0
    return sum(
        place(stream["last-generated-id"])[0] - place(group["last-delivered-id"])[0] + int(group["pending"])
        for group in groups
        if group["name"] == GROUP.encode()
    )


def silent_agents(client: Any, keys: RunKeys, agents: set[bytes]) -> set[bytes]:  # noqa: ANN401 - or a pipeline
    """Return those simulated agents which give no sign of life.

    Their leases would expire by themselves; a learner that starts again need not wait for that. A robot's
    work is left to it: its agent keeps what it did, and comes back.
    """
    if not agents or client.get(keys.agent_kind) == b"robot":
        return set()
    seconds, _ = client.time()
    return agents - set(client.zrangebyscore(keys.heartbeats, seconds - ALIVE_SECONDS, "+inf"))


def idle_consumers(client: Any, keys: RunKeys) -> list[bytes]:  # noqa: ANN401 - or a pipeline
    """Return the consumers that simulated agents left behind: they hold nothing and never come back.

    A simulated agent's name is never used again; a robot's may be, and its place in the group is kept.
    """
    if client.get(keys.agent_kind) == b"robot":
        return []
    alive = set(client.zrange(keys.heartbeats, 0, -1))
    consumers = client.xinfo_consumers(keys.work, GROUP)
    return [item["name"] for item in consumers if item["pending"] == 0 and item["name"] not in alive]
