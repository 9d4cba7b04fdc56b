"""The stream of open slots, as learner and agents see it."""

from typing import Any

import msgspec
import redis

from taskschema.bus.keys import GROUP, RunKeys
from taskschema.bus.messages import WorkItem

ITEM = b"item"


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
