"""Which results a learner lets in: the checks, without Redis."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import msgspec

from taskschema.bus.messages import SlotHeader
from taskschema.config import PROTOCOL_VERSION
from taskschema.errors import WireError
from taskschema.trajectory import Trajectory, TrajectoryFormat, decode_slot

HEADER = b"header"
DATA = b"data"
MAX_HEADER_BYTES = 4_096


@dataclass(frozen=True)
class SlotResult:
    """One slot's checked trajectories."""

    round: int
    slot: int
    trajectories: list[Trajectory]
    """In the order of their episodes."""
    worker: str
    """Who ran it; nothing depends on it."""
    digest: str
    """SHA-256 of the encoded trajectories: the same for everyone who runs the slot."""


class RefusedError(WireError):
    """A result that is not let in."""

    def __init__(self, reason: str, kind: str, slot: int | None = None) -> None:
        super().__init__(reason, kind)
        self.slot = slot
        """Slot of the open round that has to be run again; None: no result was lost."""


class Admission:
    """The door of one open round."""

    def __init__(
        self,
        round_index: int,
        slots: Iterable[int],
        policy_sha256: str,
        config_hash: str,
        expected: TrajectoryFormat,
    ) -> None:
        self.round = round_index
        self.slots = frozenset(slots)
        self.policy_sha256 = policy_sha256
        self._config_hash = config_hash
        self._expected = expected
        self._digests: dict[int, str] = {}

    @property
    def missing(self) -> list[int]:
        """Slots that no result was let in for, ascending."""
        return sorted(self.slots - self._digests.keys())

    def admit(self, fields: Mapping[bytes, bytes], *, inherited: bool = False) -> SlotResult | None:
        """Check an entry of the trajectories stream and let it in.

        Args:
            fields: header and data as they stand in the stream.
            inherited: whether it was there before this learner came: then it may belong to a round after
                the open one, if this learner resumed from an older checkpoint.

        Returns:
            The result, or None for what is merely late: it belongs to a round that is over.

        Raises:
            RefusedError: for everything else.

        """
        header = self._header(fields)
        if header.round < self.round or (inherited and header.round > self.round):
            return None
        if header.round > self.round:
            raise RefusedError(f"round {header.round} is not open, {self.round} is", "wrong_round")
        if header.slot not in self.slots:
            raise RefusedError(f"round {self.round} has no slot {header.slot}", "unknown_slot")
        data = fields[DATA]
        digest = hashlib.sha256(data).hexdigest()
        lost = None if header.slot in self._digests else header.slot
        if header.policy_sha256 != self.policy_sha256:
            raise RefusedError("computed with another policy", "foreign_policy", lost)
        if header.bad_frame:
            raise RefusedError(header.bad_frame, "bad_frame", lost)
        if header.slot in self._digests:
            same = digest == self._digests[header.slot]
            raise RefusedError("the slot is there already", "duplicate" if same else "different_duplicate")
        result = SlotResult(
            header.round, header.slot, self._trajectories(header, data), header.worker, digest
        )
        self._digests[header.slot] = digest
        return result

    def _header(self, fields: Mapping[bytes, bytes]) -> SlotHeader:
        if set(fields) != {HEADER, DATA}:
            raise RefusedError("an entry has a header and data, nothing else", "malformed")
        if len(fields[HEADER]) > MAX_HEADER_BYTES:
            raise RefusedError(f"a header of {len(fields[HEADER])} bytes", "oversized")
        try:
            header = msgspec.json.decode(fields[HEADER], type=SlotHeader)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise RefusedError(f"malformed header: {str(error)[:200]}", "malformed") from None
        if header.protocol != PROTOCOL_VERSION:
            raise RefusedError(f"protocol {header.protocol}, here {PROTOCOL_VERSION}", "foreign_protocol")
        if header.config_hash != self._config_hash:
            raise RefusedError("from a run of another config", "foreign_config")
        return header

    def _trajectories(self, header: SlotHeader, data: bytes) -> list[Trajectory]:
        try:
            trajectories = decode_slot(data, self._expected)
        except WireError as error:
            raise RefusedError(str(error), error.kind, header.slot) from None
        first = trajectories[0]
        if (first.round, first.slot) != (header.round, header.slot):
            reason = f"the header says slot {header.slot}, the data slot {first.slot} of round {first.round}"
            raise RefusedError(reason, "malformed", header.slot)
        return trajectories
