"""The learner: what turns a round's trajectories into the next policy version."""

import os
from collections.abc import Sequence

import numpy as np
import torch

from taskschema.arrays import AnyArray, Float32Array, FloatArray
from taskschema.config import RunConfig
from taskschema.errors import ConfigError, SchemaMismatchError
from taskschema.policies import PolicySnapshot
from taskschema.randomness import Purpose, round_generator
from taskschema.schema import one_hot_logits
from taskschema.tasks.task import Task
from taskschema.trajectory import Trajectory
from taskschema_learner.networks.argument_network import ArgumentNetwork
from taskschema_learner.networks.initial_weights import first_weights
from taskschema_learner.networks.spatial_network import SpatialNetwork
from taskschema_learner.schema_trainers import make_schema_trainer
from taskschema_learner.update.batch import collate, in_order
from taskschema_learner.update.optimiser import Optimiser, UpdateStatistics

__all__ = ["Learner", "UpdateStatistics"]

RECENT_SUCCESSES = 100
"""How many of the last successes decide which rows of the schema count as used."""
NEEDED_SHARE = 0.1
"""A row is used if at least this share of the recent successes came at its step or later."""


class Learner:
    """Network, optimiser and schema of one run (paper, Algorithm 1).

    policy `schema`: PPO trains the network, the schema trainer the logits. `state`: the network chooses the
    pair, too, and the logits stay zero. `oracle`: the logits are the task's known schema and stay so.
    """

    def __init__(
        self,
        config: RunConfig,
        task: Task,
        device: str = "cpu",
        trunk: dict[str, Float32Array] | None = None,
        initial_policy: PolicySnapshot | None = None,
    ) -> None:
        """Start with the config's first weights.

        Args:
            config: of the run.
            task: of the run.
            device: `cpu` or `cuda`.
            trunk: weights of VGG16, where the config names a file.
            initial_policy: the one that the config names, if it does.

        Raises:
            ConfigError: if the device is not there, the policy is another one or does not fit, or the trunk
                is missing.

        """
        _prepare(device)
        self._config = config
        self._task = task
        self._network = _first_network(
            config, task, device, _first_weights(config, task, trunk, initial_policy)
        )
        self._optimiser = Optimiser(self._network, config.ppo)
        self._schema_trainer = make_schema_trainer(config.schema)
        self._logits = _initial_logits(config, task)
        self._version = 0
        self._snapshot: PolicySnapshot | None = None
        self._success_lengths = np.zeros(0, dtype=np.int64)

    @property
    def version(self) -> int:
        """The number of updates made."""
        return self._version

    @property
    def logits(self) -> FloatArray:
        """[T, |X|] the schema's logits."""
        return self._logits.copy()

    @property
    def used_steps(self) -> int | None:
        """How many rows of the schema the recent successes needed; None before the first success.

        Rows from there on are not trained towards anything.
        """
        lengths = self._success_lengths
        if len(lengths) == 0:
            return None
        needed = [np.mean(lengths > step) >= NEEDED_SHARE for step in range(self._task.horizon)]
        return int(np.flatnonzero(needed)[-1]) + 1

    def snapshot(self) -> PolicySnapshot:
        """Return the present policy version, to be published: copied and hashed once, not to be changed."""
        if self._snapshot is None:
            self._snapshot = PolicySnapshot(self._version, self._network.weights(), self.logits)
        return self._snapshot

    def update(self, trajectories: Sequence[Trajectory]) -> UpdateStatistics:
        """Train on the trajectories of round `version`, in whatever order they come.

        Raises:
            ValueError: if there are none, or one is of another round.

        """
        if not trajectories or any(item.round != self._version for item in trajectories):
            raise ValueError(f"An update of version {self._version} takes trajectories of that round.")
        self._snapshot = None
        ordered = in_order(trajectories)
        rng = round_generator(self._config.seed, self._version, Purpose.MINIBATCHES)
        statistics = self._optimiser.update(collate(ordered, self._task, self._config.observation), rng)
        if self._config.policy == "schema" and not self._config.schema.frozen:
            self._logits = self._schema_trainer.update(self._logits, ordered)
        lengths = [len(item) for item in ordered if item.success]
        self._success_lengths = np.append(self._success_lengths, lengths)[-RECENT_SUCCESSES:].astype(np.int64)
        self._version += 1
        return statistics

    def arrays(self) -> dict[str, AnyArray]:
        """Return everything that the next updates depend on, by name, for a checkpoint."""
        return {
            **{f"weights.{name}": array for name, array in self._network.weights().items()},
            **{f"adam.{name}": array for name, array in self._optimiser.arrays().items()},
            "schema.logits": self.logits,
            "schema.success_lengths": self._success_lengths.copy(),
            "version": np.array(self._version, dtype=np.int64),
        }

    def restore(self, arrays: dict[str, AnyArray]) -> None:
        """Take over what `arrays` returned, in a learner of the same config.

        Raises:
            ConfigError: if the arrays are of another network, task or format.

        """
        try:
            logits = arrays["schema.logits"]
            if logits.shape != self._logits.shape:
                raise ValueError(f"the schema's logits have shape {logits.shape}, not {self._logits.shape}")
            self._snapshot = None
            self._network.load(_section(arrays, "weights."))
            self._optimiser.load(_section(arrays, "adam."))
            self._logits = logits.astype(np.float64)
            self._success_lengths = arrays["schema.success_lengths"].astype(np.int64)
            self._version = int(arrays["version"])
        except (KeyError, ValueError) as error:
            raise ConfigError(f"The checkpoint does not fit this run's config: {error}.") from None


def _first_weights(
    config: RunConfig,
    task: Task,
    trunk: dict[str, Float32Array] | None,
    initial_policy: PolicySnapshot | None,
) -> dict[str, Float32Array]:
    """Return the weights that the run starts with: drawn, or those of the policy that the config names."""
    given = None if initial_policy is None else initial_policy.sha256
    if given != config.initial_policy:
        raise ConfigError(f"The run starts from policy {config.initial_policy}, not from {given}.")
    if initial_policy is not None:
        return initial_policy.weights
    if config.image.vgg_sha256 is not None and trunk is None:
        raise ConfigError("The run's trunk has published weights: give them with --vgg-weights FILE.")
    return first_weights(config, task, trunk)


def _first_network(
    config: RunConfig, task: Task, device: str, weights: dict[str, Float32Array]
) -> ArgumentNetwork | SpatialNetwork:
    """Return the run's network with its first weights.

    Raises:
        ConfigError: if they are of another network.

    """
    network: ArgumentNetwork | SpatialNetwork
    if config.observation == "image":
        network = SpatialNetwork(task, config.image, device)
    else:
        pairs = len(task.pairs) if config.policy == "state" else 0
        sizes = (task.observation.size, config.network.hidden, task.pairs.argument_count)
        network = ArgumentNetwork(*sizes, pairs, device)
    try:
        network.load(weights)
    except ValueError as error:
        raise ConfigError(f"The policy to start from does not fit this run: {error}") from None
    return network


def _prepare(device: str) -> None:
    """Make torch's results a function of its inputs alone.

    Raises:
        ConfigError: if the device is not there.

    """
    if device not in ("cpu", "cuda"):
        raise ConfigError(f"Device {device!r} must be 'cpu' or 'cuda'.")
    if device == "cuda":
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # cuBLAS is deterministic only so
        if not torch.cuda.is_available():
            raise ConfigError("Device 'cuda' is not available here: a new run can use --device cpu.")
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    # Nothing reads such memory, and filling it takes a tenth of an update's time.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]


def _initial_logits(config: RunConfig, task: Task) -> FloatArray:
    shape = (task.horizon, len(task.pairs))
    if config.policy == "oracle":
        return one_hot_logits(task.paper_pairs, *shape)
    if config.policy == "state" or config.schema.initial_logits is None:
        return np.zeros(shape)
    rows = config.schema.initial_logits
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        raise SchemaMismatchError(f"Initial schema logits must have shape {shape} for task {task.name!r}.")
    return np.array(rows, dtype=np.float64)


def _section(arrays: dict[str, AnyArray], prefix: str) -> dict[str, AnyArray]:
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
