"""Configuration of a run: everything that its results are a function of."""

import hashlib
import math
import re
from typing import Any, Literal

import msgspec

from taskschema.errors import ConfigError, UnknownNameError

FORMAT_VERSION = 1
"""Version of the run folder; a folder of another version is refused."""
PROTOCOL_VERSION = 2
"""Version of the messages on the bus; agents and learner compare it before they talk."""

LATER_FIELDS = ("safety_gate", "initial_policy")
"""Fields of `RunConfig` that are newer than runs there are; unset, they are no part of the config's hash."""

PolicyKind = Literal["schema", "state", "oracle"]
ObservationKind = Literal["state", "image"]


def _require(condition: bool, field: str, accepted: str) -> None:
    if not condition:
        raise ConfigError(f"Config field {field!r} must be {accepted}.")


class PPOConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the policy gradient; the paper's values are the defaults where it gives one."""

    algorithm: str = "ppo"
    """Name of the algorithm, the loss of the argument network (paper: PPO; the method is agnostic to it)."""
    learning_rate: float = 0.001
    """Step size of Adam (paper: 0.001; robot: 0.005)."""
    adam_epsilon: float = 1e-5
    """Adam's epsilon (Stable Baselines' default)."""
    clip: float = 0.2
    """Clipping parameter of the probability ratio (paper: 0.2)."""
    value_clip: float | None = 0.2
    """Clipping of the value's change (Stable Baselines' default: 0.2); None: no clipping."""
    entropy_coefficient: float = 0.01
    """Entropy loss coefficient (paper: 0.01)."""
    value_coefficient: float = 0.5
    """Value loss coefficient (paper: 0.5)."""
    max_gradient_norm: float = 0.5
    """Gradient clip threshold (paper: 0.5)."""
    minibatches: int = 4
    """Minibatches per epoch (paper: 4; robot: 10)."""
    epochs: int = 4
    """Optimisation epochs per update (paper: 4; robot: 10)."""
    gamma: float = 0.99
    """Discount per step (Stable Baselines' default)."""
    gae_lambda: float = 0.95
    """Lambda of generalised advantage estimation (Stable Baselines' default)."""
    advantage_std_floor: float = 0.1
    """Least standard deviation that advantages are divided by: with no success in a batch they are noise."""

    def __post_init__(self) -> None:
        positive = ("learning_rate", "adam_epsilon", "clip", "max_gradient_norm", "minibatches", "epochs")
        for name in positive:
            _require(getattr(self, name) > 0, name, "above 0")
        for name in ("entropy_coefficient", "value_coefficient", "advantage_std_floor"):
            _require(getattr(self, name) >= 0, name, "at least 0")
        for name in ("gamma", "gae_lambda"):
            _require(0 <= getattr(self, name) <= 1, name, "in [0, 1]")


class SchemaConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the schema's update (paper, Algorithm 1)."""

    trainer: str = "algorithm1"
    """Name of the schema trainer."""
    alpha: float = 4.0
    """Added to the logits of a successful trajectory's (step, pair)s (the paper gives no value)."""
    beta: float = 0.008
    """Subtracted for a failed one (the paper gives no value)."""
    initial_logits: tuple[tuple[float, ...], ...] | None = None
    """[T, |X|] logits to start from (`--init-schema`); None: zeros, as in the paper."""
    frozen: bool = False
    """Whether the logits stay as they are (`--freeze-schema`)."""

    def __post_init__(self) -> None:
        for name in ("alpha", "beta"):
            value = getattr(self, name)
            _require(value >= 0 and math.isfinite(value), name, "finite and at least 0")


class NetworkConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the argument network."""

    hidden: tuple[int, ...] = (64, 64, 64, 64)
    """Units of the hidden layers, ReLU each (paper: 4 layers of 64)."""
    initial_log_std: float = -1.0
    """Log standard deviation of every argument at the start [normalised units, search space = +-1]."""

    def __post_init__(self) -> None:
        _require(len(self.hidden) > 0 and all(size > 0 for size in self.hidden), "hidden", "sizes above 0")


class ImageConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the spatial network, of runs on images alone."""

    trunk: Literal["small", "vgg16"] = "small"
    """What turns a frame into feature maps (paper: VGG16's first four blocks)."""
    vgg_sha256: str | None = None
    """SHA-256 of the file with VGG's published weights (`--vgg-weights`); None: random ones."""

    randomise_visuals: bool = False
    """Whether colours, light and the camera's pose vary by episode (`--randomise-visuals`)."""

    def __post_init__(self) -> None:
        _require(self.vgg_sha256 is None or self.trunk == "vgg16", "image.trunk", "vgg16 with --vgg-weights")

    @property
    def trunk_is_frozen(self) -> bool:
        """Whether the trunk stays as it starts: VGG's does, the small one is trained with the rest."""
        return self.trunk == "vgg16"


class RunConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What one run's results depend on; `config_hash` covers exactly this."""

    task: str
    """Registered task, or the class in `task_source`."""
    task_source: str | None = None
    """Source text of a user's task file (`--task-file`), so that workers elsewhere run the same task."""
    policy: PolicyKind = "schema"
    """`schema`: the paper's method; `state`: its baseline; `oracle`: the schema is given."""
    observation: ObservationKind = "state"
    """What the network sees."""
    seed: int = 0
    """Seed of the run."""
    slots: int = 50
    """Slots a round (paper: 50 workers)."""
    episodes_per_slot: int = 4
    """Whole episodes a slot: ceil(10 / T) (paper: 10 steps a worker)."""
    ppo: PPOConfig = PPOConfig()
    schema: SchemaConfig = SchemaConfig()
    network: NetworkConfig = NetworkConfig()
    image: ImageConfig = ImageConfig()
    safety_gate: bool = False
    """Whether simulation makes the robot's checks before every motion and refuses as it does
    (`--safety-gate`)."""
    initial_policy: str | None = None
    """SHA-256 of the policy whose weights the network starts with (`--init-policy`), which the run's folder
    keeps; None: random ones, as in the paper."""

    def __post_init__(self) -> None:
        _require(0 <= self.seed < 2**63, "seed", "between 0 and 2^63 - 1")
        _require(1 <= self.slots <= 100_000, "slots", "between 1 and 100000")
        _require(1 <= self.episodes_per_slot <= 1_000, "episodes_per_slot", "between 1 and 1000")
        is_hash = self.initial_policy is None or re.fullmatch("[0-9a-f]{64}", self.initial_policy)
        _require(bool(is_hash), "initial_policy", "a SHA-256 in hexadecimal")
        if self.observation == "image" and self.policy == "state":
            raise ConfigError(
                "The baseline `--policy state` chooses skills from the low-dimensional state: "
                "use --policy schema or oracle with --observation image."
            )

    @property
    def config_hash(self) -> str:
        """SHA-256 of the configuration, in hexadecimal.

        Image settings count where images are seen; what came later than the first runs counts where it is
        used, so that those keep their hashes.
        """
        data = msgspec.to_builtins(self)
        if self.observation != "image":
            del data["image"]
        for name in LATER_FIELDS:
            if not data[name]:
                del data[name]
        return hashlib.sha256(msgspec.json.encode(data, order="deterministic")).hexdigest()


def parse_config(data: bytes) -> RunConfig:
    """Parse a `config.json`.

    Raises:
        ConfigError: if it is not a valid configuration; the message names the field.
    """
    try:
        return msgspec.json.decode(data, type=RunConfig)
    except msgspec.ValidationError as error:
        raise ConfigError(f"Run config: {error}.") from None
    except msgspec.DecodeError as error:
        raise ConfigError(f"Run config is not valid JSON: {error}.") from None


def override(config: RunConfig, assignments: dict[str, str]) -> RunConfig:
    """Return the config with dotted fields set from text, for example `{"ppo.learning_rate": "0.005"}`.

    Raises:
        UnknownNameError: for a field that does not exist; ConfigError for a value that does not fit.
    """
    data: dict[str, Any] = msgspec.to_builtins(config)
    for name, text in assignments.items():
        *parents, leaf = name.split(".")
        section = data
        for parent in parents:
            child = section.get(parent)
            section = child if isinstance(child, dict) else {}
        if leaf not in section or isinstance(section[leaf], dict):
            raise UnknownNameError("config field", name, _field_names(data))
        try:
            section[leaf] = msgspec.json.decode(text)
        except msgspec.DecodeError:
            section[leaf] = text
    return parse_config(msgspec.json.encode(data))


def _field_names(data: dict[str, Any], prefix: str = "") -> list[str]:
    names = []
    for key, value in data.items():
        names += _field_names(value, f"{prefix}{key}.") if isinstance(value, dict) else [prefix + key]
    return names
