"""Headers of what travels between learner and agents: small, typed, and checked when they arrive."""

from typing import Annotated

import msgspec

Count = Annotated[int, msgspec.Meta(ge=0, lt=2**31)]
Sha256 = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=128)]
Line = Annotated[str, msgspec.Meta(max_length=500, pattern=r"^[ -~]*\Z")]


class WorkItem(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One slot that somebody is asked to run."""

    round: Count
    slot: Count
    policy_sha256: Sha256
    """Hash of the policy to run it with: a policy of the same version from another run will not do."""


class SlotHeader(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What stands before one slot's trajectories on the wire, or instead of them."""

    protocol: Count
    """`PROTOCOL_VERSION` of the sender."""
    config_hash: Sha256
    round: Count
    slot: Count
    policy_sha256: Sha256
    """Hash of the policy that acted."""
    worker: Name
    """Who ran it; for people only, nothing depends on it."""
    bad_frame: Line = ""
    """Why the slot could not be run: what is wrong with the camera's frame. No trajectories follow then."""
