"""What a run is doing, as everybody may see it."""

from typing import Literal

import msgspec

RunState = Literal["starting", "running", "paused", "finished", "stopped", "failed"]


class RunStatus(msgspec.Struct, frozen=True, kw_only=True):
    """What a run is doing."""

    run: str
    state: RunState = "starting"
    """`starting`, `running`, `paused`, `finished`, `stopped` (it can be resumed) or `failed`."""
    round: int = 0
    """Round that is being collected, from 0."""
    version: int = 0
    """Policy version: the number of updates so far."""
    message: str = ""
    """Why it is in this state, for a person; empty if there is nothing to say."""
    api: str | None = None
    """Address of the HTTP API that the run's own command started, if it did."""
    started_at: str = ""
    """UTC time at which the run was registered, ISO 8601."""
    updated_at: str = ""
    """UTC time of the latest change of this status, ISO 8601."""
    alive_at: str = ""
    """UTC time of the learner's latest sign of life, ISO 8601: every two seconds, by its own clock."""
