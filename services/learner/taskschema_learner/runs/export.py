"""Trajectories as files for analysis elsewhere."""

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from taskschema.config import ObservationKind
from taskschema.errors import ConfigError, RunFolderError
from taskschema.policies.spatial_layout import SpatialLayout
from taskschema.skills.pairs import PairSpace
from taskschema.tasks.task import Task
from taskschema.trajectory import Trajectory

FORMATS = (".npz", ".jsonl")


def write_trajectories(
    path: Path, task: Task, trajectories: Sequence[Trajectory], observation: ObservationKind = "state"
) -> None:
    """Write trajectories as `.npz` (padded arrays) or `.jsonl` (one episode a line).

    Observations and arguments are in SI units. In `.npz`, N episodes are padded to T steps: `length` [N],
    `success` [N], `round`, `slot`, `episode` [N], `observations` [N, T, D], `pairs` [N, T] (-1 beyond the
    end), `arguments` [N, T, A] and `raw_arguments` [N, T, A] (Gaussian samples, normalised); and the names:
    `pair_names` [|X|, 2], `argument_names` [A], `observation_names` [D].

    Of runs on images, `.npz` holds frames [N, T, 256, 256, 3] without names, and raw arguments [N, T, R] as
    `SpatialLayout` has them; `.jsonl` leaves the frames out.

    Raises:
        ConfigError: for another ending; RunFolderError: if the file cannot be written.

    """
    require_format(path)
    temporary = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        if path.suffix == ".npz":
            np.savez_compressed(temporary, allow_pickle=False, **_arrays(task, trajectories, observation))
        else:
            with temporary.open("wb") as file:
                file.writelines(_line(task, item, observation) for item in trajectories)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise RunFolderError(f"{path} cannot be written: {error.strerror}.") from None


def require_format(path: Path) -> None:
    """Refuse a file whose ending names no format.

    Raises:
        ConfigError: that names those there are.

    """
    if path.suffix not in FORMATS:
        raise ConfigError(f"Cannot export to {path}: its name must end in {' or '.join(FORMATS)}.")


def _arrays(
    task: Task, trajectories: Sequence[Trajectory], observation: ObservationKind
) -> dict[str, np.ndarray]:
    count, horizon = len(trajectories), task.horizon
    first, space = trajectories[0], task.seen_pairs(observation)
    observations = np.zeros((count, horizon, *first.observations.shape[1:]), first.observations.dtype)
    pairs = np.full((count, horizon), -1, dtype=np.int64)
    raw = np.zeros((count, horizon, first.arguments.shape[1]), dtype=np.float32)
    arguments = np.zeros((count, horizon, space.argument_count))
    for row, item in enumerate(trajectories):
        steps = len(item)
        observations[row, :steps], pairs[row, :steps] = item.observations, item.pairs
        raw[row, :steps], arguments[row, :steps] = item.arguments, _si_arguments(space, item)
    return {
        "round": np.array([item.round for item in trajectories]),
        "slot": np.array([item.slot for item in trajectories]),
        "episode": np.array([item.episode for item in trajectories]),
        "length": np.array([len(item) for item in trajectories]),
        "success": np.array([item.success for item in trajectories]),
        "diverged": np.array([item.diverged for item in trajectories]),
        "observations": observations,
        "pairs": pairs,
        "arguments": arguments,
        "raw_arguments": raw,
        "pair_names": np.array(task.pairs.pairs),
        "argument_names": np.array(_argument_names(space)),
        "observation_names": np.array(_observation_names(task) if observation == "state" else []),
    }


def _line(task: Task, item: Trajectory, observation_kind: ObservationKind) -> bytes:
    space = task.seen_pairs(observation_kind)
    names = _argument_names(space)
    si = _si_arguments(space, item)
    fields = task.observation.fields if observation_kind == "state" else ()
    steps = []
    for step, pair in enumerate(item.pairs):
        left, right = task.pairs.pairs[pair]
        used = np.flatnonzero(space.used[pair])
        observation = {
            field.name: task.observation.get(item.observations[step], field.name).tolist() for field in fields
        }
        arguments = {names[index]: float(si[step, index]) for index in used}
        steps.append({"left": left, "right": right, "arguments": arguments, "observation": observation})
    facts = {"round": item.round, "slot": item.slot, "episode": item.episode}
    return (
        msgspec.json.encode({**facts, "success": item.success, "diverged": item.diverged, "steps": steps})
        + b"\n"
    )


def _si_arguments(space: PairSpace, item: Trajectory) -> np.ndarray:
    """Return the arguments that were executed [L, A]; 0 where the pair does not use them."""
    on_images = item.observations.dtype == np.uint8
    si = SpatialLayout(space).to_si(item.arguments) if on_images else space.to_si(item.arguments)
    return np.where(space.used[item.pairs], si, 0.0)


def _argument_names(space: PairSpace) -> list[str]:
    named = zip(space.argument_names, space.arguments, strict=True)
    return [f"{name} [{argument.unit}]" for name, argument in named]


def _observation_names(task: Task) -> list[str]:
    return [
        f"{field.name}[{index}] [{field.unit}]"
        for field in task.observation.fields
        for index in range(field.size)
    ]
