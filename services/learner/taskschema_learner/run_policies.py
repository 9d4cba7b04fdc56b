"""The policies that a run's folder keeps: its newest, and the one that it started from."""

from taskschema.errors import RunFolderError, WireError
from taskschema.policies import PolicySnapshot
from taskschema_learner.run_folder import RunFolder


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
