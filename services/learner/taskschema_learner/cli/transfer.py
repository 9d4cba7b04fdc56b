"""What `taskschema train` takes over from runs before: a schema (the paper's transfer), or a policy."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taskschema.arrays import Float32Array
    from taskschema.config import RunConfig
    from taskschema.policies import PolicySnapshot


def initial_logits(
    reference: str, config: "RunConfig", public_key: Path | None = None
) -> tuple[tuple[float, ...], ...]:
    """Return the logits of a schema file, or of a run.

    Raises:
        TaskschemaError: if there is none, it does not fit the task, or the owner of a configured public key
            did not sign it.

    """
    from taskschema.errors import SignatureError
    from taskschema.schema import logits_from_document
    from taskschema.tasks.registry import task_of
    from taskschema_learner.cli.run_reference import find_run
    from taskschema_learner.schema_file import read_schema
    from taskschema_learner.signing import read_public_key

    path = Path(reference)
    trusted = None if public_key is None else read_public_key(public_key)
    if path.is_file():
        document = read_schema(path, trusted)
    else:
        folder = find_run(reference)
        if trusted is not None:
            raise SignatureError(
                f"Run {folder.name} is not signed, and a public key is configured: take the file that "
                f"`taskschema schema {reference} --export FILE` writes."
            )
        document = folder.read_schema()
    task = task_of(config)
    return tuple(map(tuple, logits_from_document(document, task.pairs, task.horizon).tolist()))


def with_initial_policy(
    config: "RunConfig", reference: str | None, trunk: "dict[str, Float32Array] | None"
) -> "tuple[RunConfig, PolicySnapshot | None]":
    """Return the config that starts from the policy that was named, and that policy.

    Raises:
        TaskschemaError: if there is none, or it does not fit.

    """
    if reference is None:
        return config, None
    import msgspec

    from taskschema.tasks.registry import task_of
    from taskschema_learner.cli.run_reference import find_run
    from taskschema_learner.initial_policy import policy_of_file, policy_of_run, require_fit

    path = Path(reference)
    initial = policy_of_file(path) if path.is_file() else policy_of_run(find_run(reference))
    require_fit(initial, config, task_of(config), trunk)
    sha256 = initial.snapshot.sha256
    print(f"The network starts from {initial.name}, version {initial.snapshot.version}, SHA-256 {sha256}.")
    return msgspec.structs.replace(config, initial_policy=sha256), initial.snapshot
