"""A slot that an agent has taken on."""

from dataclasses import dataclass

from taskschema.bus.messages import WorkItem


@dataclass(frozen=True)
class Lease:
    """Holds until the slot is delivered or the agent gives no sign of life for too long."""

    entry_id: bytes
    """Place in the work stream."""
    item: WorkItem
