"""The stream of open slots, as learner and agents see it."""

from typing import Any

import msgspec
import redis

from taskschema.bus.keys import GROUP, RunKeys
from taskschema.bus.messages import WorkItem
from taskschema.bus.worker_info import ALIVE_SECONDS

ITEM = b"item"
MOST_PENDING = 100_000
"""No round has more slots."""


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


def open_items(client: Any, keys: RunKeys) -> list[tuple[bytes, WorkItem | None]]:  # noqa: ANN401 - or a pipeline
    """Return (entry id, item) of every slot that is offered or leased."""
    return [(entry_id, read_item(fields)) for entry_id, fields in client.xrange(keys.work)]


def abandoned(client: Any, keys: RunKeys) -> set[bytes]:  # noqa: ANN401 - or a pipeline
    """Return the entries that are leased to simulated agents which give no sign of life.

    Their leases would expire by themselves; a learner that starts again need not wait for that. A robot's
    work is left to it: its agent keeps what it did, and comes back.
    """
    if client.get(keys.agent_kind) == b"robot":
        return set()
    seconds, _ = client.time()
    alive = set(client.zrangebyscore(keys.heartbeats, seconds - ALIVE_SECONDS, "+inf"))
    pending = client.xpending_range(keys.work, GROUP, min="-", max="+", count=MOST_PENDING)
    return {entry["message_id"] for entry in pending if entry["consumer"] not in alive}
