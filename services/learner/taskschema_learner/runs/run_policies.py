"""What a run's folder keeps of policies: the newest one, and what the run started from."""

import numpy as np

from taskschema.arrays import Float32Array
from taskschema.errors import RunFolderError, WireError
from taskschema.policies import PolicySnapshot
from taskschema_learner.runs.checkpoint import load_latest
from taskschema_learner.runs.run_folder import TRUNK, RunFolder

_TRUNK_ARRAYS = "weights.trunk."


def newest_policy(folder: RunFolder) -> PolicySnapshot:
    """Return a run's newest policy.

    Raises:
        RunFolderError: if there is none yet, or it is damaged.

    """
    try:
        return PolicySnapshot.from_bytes(folder.read_policy())
    except WireError as error:
        raise RunFolderError(
            f"The policy in {folder.path} is damaged ({error}): continue the run with --resume to mend it."
        ) from None


def initial_policy_of(folder: RunFolder) -> PolicySnapshot | None:
    """Return the policy that a run started from; None: it started from random weights.

    Raises:
        RunFolderError: if it is gone, or damaged.

    """
    data = folder.read_initial_policy()
    try:
        snapshot = None if data is None else PolicySnapshot.from_bytes(data)
    except WireError as error:
        raise RunFolderError(
            f"The policy that the run in {folder.path} started from is damaged ({error}): "
            "restore it from a backup."
        ) from None
    if snapshot is not None and snapshot.sha256 != folder.config.initial_policy:
        raise RunFolderError(
            f"The run in {folder.path} started from another policy than the one kept there: "
            "restore it from a backup."
        )
    return snapshot


def trunk_to_bytes(trunk: dict[str, Float32Array]) -> bytes:
    """Encode published weights of a trunk as a policy without anything else, whose hash is checked."""
    return PolicySnapshot(0, trunk, np.zeros((0, 0))).to_bytes()


def published_trunk(folder: RunFolder) -> dict[str, Float32Array] | None:
    """Return the published weights that a run's frozen trunk has; None: none, or those of its first policy.

    A run from before folders kept them has them in its checkpoints.

    Raises:
        RunFolderError: if they are nowhere, or damaged.

    """
    if folder.config.image.vgg_sha256 is None or folder.config.initial_policy is not None:
        return None
    data = folder.read_trunk()
    try:
        if data is not None:
            return PolicySnapshot.from_bytes(data).weights
    except WireError as error:
        raise RunFolderError(
            f"{folder.path / TRUNK} is damaged ({error}): restore it from a backup."
        ) from None
    checkpoint = load_latest(folder.checkpoints)
    if checkpoint is None:
        raise RunFolderError(
            f"The run in {folder.path} has no checkpoint yet, and its trunk's weights are not kept there: "
            "continue it with --resume --vgg-weights FILE."
        )
    arrays = checkpoint.arrays
    return {name.removeprefix("weights."): arrays[name] for name in arrays if name.startswith(_TRUNK_ARRAYS)}
