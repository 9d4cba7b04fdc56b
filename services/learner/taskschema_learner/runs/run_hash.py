"""The hash of what a run has learned."""

from taskschema.errors import RunFolderError
from taskschema.policies import PolicySnapshot
from taskschema_learner.runs.checkpoint import Checkpoint, load_latest
from taskschema_learner.runs.run_folder import RunFolder

_WEIGHTS = "weights."


def run_hash(folder: RunFolder) -> str:
    """Return the SHA-256 over weights and logits in the newest checkpoint that is whole, in hexadecimal.

    Raises:
        RunFolderError: if there is no checkpoint yet, or none that is whole.

    """
    checkpoint = load_latest(folder.checkpoints)
    if checkpoint is None:
        raise RunFolderError(f"The run in {folder.path} has no checkpoint yet: train it first.")
    return policy_hash(checkpoint)


def policy_hash(checkpoint: Checkpoint) -> str:
    """Return the SHA-256 over a checkpoint's weights and logits, in hexadecimal."""
    arrays = checkpoint.arrays
    weights = {name.removeprefix(_WEIGHTS): arrays[name] for name in arrays if name.startswith(_WEIGHTS)}
    return PolicySnapshot(checkpoint.round, weights, arrays["schema.logits"]).sha256
