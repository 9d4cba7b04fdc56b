"""Starting from another run's policy: which one is meant, and whether it fits.

The paper transfers the schema only; this goes beyond it.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taskschema.arrays import Float32Array
from taskschema.config import RunConfig
from taskschema.errors import ConfigError, RunFolderError, WireError
from taskschema.policies import PolicySnapshot
from taskschema.tasks.registry import task_of
from taskschema.tasks.task import Task
from taskschema_learner.networks.initial_weights import first_weights
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import newest_policy

MAX_POLICY_BYTES = 256 * 1024 * 1024
"""No policy file is larger: the largest of this project's, with VGG16's blocks, has some 40 MiB."""


@dataclass(frozen=True)
class InitialPolicy:
    """A policy that a new run starts from."""

    name: str
    """What the user called it."""
    snapshot: PolicySnapshot
    config: RunConfig | None
    """Of its run; None: it is a file alone."""


def policy_of_run(folder: RunFolder) -> InitialPolicy:
    """Return the newest policy of a run.

    Raises:
        RunFolderError: if there is none, or it is damaged.

    """
    return InitialPolicy(str(folder.path), newest_policy(folder), folder.config)


def policy_of_file(path: Path) -> InitialPolicy:
    """Return the policy in a file: a run's `policy.safetensors`, or what `GET /policy` answers.

    Raises:
        RunFolderError: if it cannot be read or is none.

    """
    try:
        if path.stat().st_size > MAX_POLICY_BYTES:
            raise RunFolderError(f"{path} is no policy: it has more than {MAX_POLICY_BYTES} bytes.")
        return InitialPolicy(str(path), PolicySnapshot.from_bytes(path.read_bytes()), None)
    except OSError as error:
        raise RunFolderError(f"The policy {path} cannot be read: {error.strerror}.") from None
    except WireError as error:
        raise RunFolderError(
            f"{path}: {error}. --init-policy takes a run, or a `policy.safetensors` from its folder."
        ) from None


def require_fit(
    initial: InitialPolicy, config: RunConfig, task: Task, trunk: dict[str, Float32Array] | None = None
) -> None:
    """Refuse a policy that acts in another way than a run's network does.

    Args:
        initial: to start from.
        config: of the run.
        task: of the run.
        trunk: published weights that the run's frozen trunk must have.

    Raises:
        ConfigError: that says everything that differs.

    """
    differences = list(_shape_differences(initial.snapshot, config, task))
    if initial.config is not None:
        differences = list(_run_differences(initial.config, config, task)) or differences
    elif not differences and trunk is not None:
        differences = _trunk_differences(initial.snapshot, trunk)
    if differences:
        raise ConfigError(
            f"The policy of {initial.name} does not fit this run: {'; '.join(differences)}. "
            "Give --init-policy a run of the same task, skills and observation, or leave it out."
        )


def _run_differences(theirs: RunConfig, ours: RunConfig, task: Task) -> Iterable[str]:
    """Yield what about their run makes its network another one."""
    other = task_of(theirs)
    rows: list[tuple[str, object, object]] = [
        ("observation", theirs.observation, ours.observation),
        ("steps an episode", other.horizon, task.horizon),
        ("skills", _skills(other), _skills(task)),
        ("chooses skills from the state", theirs.policy == "state", ours.policy == "state"),
    ]
    if ours.observation == "image":
        rows.append(("trunk", theirs.image.trunk, ours.image.trunk))
        rows.append(("trunk's published weights", theirs.image.vgg_sha256, ours.image.vgg_sha256))
    else:
        rows.append(("hidden layers", theirs.network.hidden, ours.network.hidden))
    for name, there, here in rows:
        if there != here:
            yield f"{name}: there {there}, here {here}"
    if _skills(other) == _skills(task) and theirs.observation == ours.observation:
        yield from _other_lines("argument", _arguments(other, theirs), _arguments(task, ours))
        if ours.observation == "state":
            yield from _other_lines("observed", _fields(other), _fields(task))


def _other_lines(word: str, there: tuple[str, ...], here: tuple[str, ...]) -> Iterable[str]:
    """Yield what one of two lists lacks, or that their order differs."""
    only = [f"{name} there" for name in there if name not in here]
    only += [f"{name} here" for name in here if name not in there]
    if only:
        yield f"{word} only {', '.join(only)}"
    elif there != here:
        yield f"{word}s in another order"


def _shape_differences(snapshot: PolicySnapshot, config: RunConfig, task: Task) -> Iterable[str]:
    wanted = (task.horizon, len(task.pairs))
    if snapshot.logits.shape != wanted:
        yield f"schema logits: there {snapshot.logits.shape}, here {wanted}"
    there = {name: array.shape for name, array in snapshot.weights.items()}
    here = {name: array.shape for name, array in first_weights(config, task).items()}
    for name in sorted(there.keys() | here.keys()):
        if there.get(name) != here.get(name):
            yield f"weights {name}: there {there.get(name)}, here {here.get(name)}"


def _trunk_differences(snapshot: PolicySnapshot, trunk: dict[str, Float32Array]) -> list[str]:
    if all(np.array_equal(snapshot.weights[name], array) for name, array in trunk.items()):
        return []
    return ["its frozen trunk has other weights than --vgg-weights"]


def _skills(task: Task) -> str:
    return ", ".join(skill.name for skill in task.pairs.skills)


def _arguments(task: Task, config: RunConfig) -> tuple[str, ...]:
    space = task.seen_pairs(config.observation)
    return tuple(
        f"{name} {argument.low:.3g} to {argument.high:.3g}"
        for name, argument in zip(space.argument_names, space.arguments, strict=True)
    )


def _fields(task: Task) -> tuple[str, ...]:
    return tuple(f"{field.name}[{field.size}]" for field in task.observation.fields)
