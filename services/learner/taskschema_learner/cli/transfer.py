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
        TaskschemaError: if there is none, it does not fit the task, all skills are equally probable in it, or
            the owner of a configured public key did not sign it.

    """
    from taskschema.errors import ConfigError, SignatureError
    from taskschema.schema import logits_from_document
    from taskschema.tasks.registry import task_of
    from taskschema_learner.cli.run_reference import find_run
    from taskschema_learner.schemas.schema_file import read_schema
    from taskschema_learner.schemas.signing import read_public_key

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
    logits = logits_from_document(document, task.pairs, task.horizon)
    if (logits == logits[:, :1]).all():
        raise ConfigError(
            f"{reference} has no schema to start from: all skills are equally probable in it, as after "
            "--policy state."
        )
    return tuple(map(tuple, logits.tolist()))


def require_useful_schema(config: "RunConfig") -> None:
    """Refuse a schema to start from, or to freeze, where nothing would come of it.

    Raises:
        ConfigError: that says so.

    """
    from taskschema.errors import ConfigError

    schema = config.schema
    if config.policy != "schema" and (schema.frozen or schema.initial_logits is not None):
        raise ConfigError(
            f"--init-schema and --freeze-schema are for --policy schema: {config.policy} learns no schema."
        )
    if schema.frozen and schema.initial_logits is None:
        raise ConfigError("--freeze-schema needs --init-schema: it would freeze a schema that says nothing.")


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
    from taskschema_learner.runs.initial_policy import policy_of_file, policy_of_run, require_fit

    path = Path(reference)
    initial = policy_of_file(path) if path.is_file() else policy_of_run(find_run(reference))
    require_fit(initial, config, task_of(config), trunk)
    sha256 = initial.snapshot.sha256
    print(f"The network starts from {initial.name}, version {initial.snapshot.version}, SHA-256 {sha256}.")
    return msgspec.structs.replace(config, initial_policy=sha256), initial.snapshot
