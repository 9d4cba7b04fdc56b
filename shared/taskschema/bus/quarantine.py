"""Refused messages: kept for a person to look at, counted, and charged to the slot they were for."""

import logging
from collections.abc import Callable
from typing import Any

from taskschema.bus.admission import DATA, HEADER, RefusedError
from taskschema.bus.keys import RunKeys
from taskschema.errors import QuarantineLimitError

log = logging.getLogger("taskschema.bus")

MOST_REFUSALS = 3
"""A slot that is refused this often stops the run."""
KEPT_MESSAGES = 1_000
"""At least this many refused messages are kept; of each, the first `KEPT_BYTES` of header and data."""
KEPT_BYTES = 4_096
ADVICE = {"bad_frame": "Mend the workers' camera, or what draws its frames (`taskschema doctor` there)"}
"""What to do before the run can go on, by kind of refusal."""
USUAL_ADVICE = "Run the same version of taskschema everywhere"

Fenced = Callable[[Callable[[Any], None]], None]
"""Runs a transaction that only the newest learner may make."""


class Quarantine:
    """Where a learner puts what it does not let in."""

    def __init__(self, fenced: Fenced, keys: RunKeys) -> None:
        self._fenced = fenced
        self._keys = keys

    def put(self, entry_id: bytes, fields: dict[bytes, bytes], error: RefusedError, round_index: int) -> None:
        """Move an entry of the trajectories stream here, and charge its slot if it had one.

        Raises:
            QuarantineLimitError: if the slot was refused three times.

        """
        about = {"round": round_index, "slot": error.slot}
        log.warning("Refused %s: %s (%s)", entry_id.decode(), error, error.kind, extra=about)
        entry: dict[bytes, bytes] = {b"kind": error.kind.encode(), b"reason": str(error).encode()}
        for name in (HEADER, DATA):
            entry[name] = fields.get(name, b"")[:KEPT_BYTES]

        def plan(pipe: Any) -> None:  # noqa: ANN401 - a pipeline, which redis-py leaves untyped
            pipe.multi()
            pipe.xdel(self._keys.trajectories, entry_id)
            pipe.xadd(self._keys.quarantine, entry, maxlen=KEPT_MESSAGES, approximate=True)
            pipe.hincrby(self._keys.quarantine_counts, error.kind, 1)

        self._fenced(plan)
        if error.slot is not None:
            self.charge(error.slot, error, round_index)

    def charge(self, slot: int, error: RefusedError, round_index: int) -> None:
        """Count that a slot has to be run again, because of a refusal that may not even have named it.

        Raises:
            QuarantineLimitError: if this is the third time.

        """
        field = f"{round_index}:{slot}"
        count = 0

        def plan(pipe: Any) -> None:  # noqa: ANN401 - a pipeline, which redis-py leaves untyped
            nonlocal count
            count = int(pipe.hget(self._keys.refusals, field) or 0) + 1
            pipe.multi()
            if count < MOST_REFUSALS:
                pipe.hset(self._keys.refusals, field, count)
            else:  # whoever goes on has mended it, and what other slots were refused for, too
                pipe.delete(self._keys.refusals)

        self._fenced(plan)
        if count >= MOST_REFUSALS:
            raise QuarantineLimitError(
                f"Slot {slot} of round {round_index} was refused {count} times, the last time because of: "
                f"{error}. {ADVICE.get(error.kind, USUAL_ADVICE)}, then --resume."
            )
