"""What an agent says about itself with every sign of life."""

from typing import Literal

import msgspec

AgentKind = Literal["simulation", "robot"]
"""Kinds of agents; the two never serve the same run."""
ALIVE_SECONDS = 5.0
"""An agent counts as alive for this long after its latest sign of life [s]; they come every second."""


class WorkerInfo(msgspec.Struct, frozen=True, kw_only=True):
    """A worker (or robot agent) of a run."""

    id: str
    kind: AgentKind
    """`simulation` or `robot`."""
    host: str
    pid: int
    """Process id on its host."""
    since: str
    """UTC time at which it joined, ISO 8601."""
    last_seen: float
    """Time since its latest sign of life [s]."""
    episodes: int
    """Episodes delivered since it joined."""
    busy_slots: int
    """Slots that it is working on."""
    episodes_per_second: float
    """Rate over about the last ten seconds."""
