"""The config of a run: validated when made, the same hash for the same content, nearest names in errors."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskschema.config import NetworkConfig, PPOConfig, RunConfig, SchemaConfig, override, parse_config
from taskschema.errors import ConfigError, UnknownNameError

configs = st.builds(
    RunConfig,
    task=st.text(max_size=20),
    task_source=st.none() | st.text(max_size=50),
    policy=st.sampled_from(["schema", "state", "oracle"]),
    seed=st.integers(0, 2**63 - 1),
    slots=st.integers(1, 1_000),
    ppo=st.builds(PPOConfig, learning_rate=st.floats(1e-6, 1.0), value_clip=st.none() | st.floats(0.1, 1)),
    schema=st.builds(
        SchemaConfig,
        alpha=st.floats(0, 10),
        initial_logits=st.none() | st.just(((0.0, 1.5), (2.0, -1e9))),
    ),
    safety_gate=st.booleans(),
    initial_policy=st.none() | st.just("ab" * 32),
)


@given(configs)
def test_config_survives_its_file(config: RunConfig) -> None:
    again = parse_config(msgspec.json.encode(config))
    assert again == config
    assert again.config_hash == config.config_hash


@given(configs, configs)
def test_hash_tells_configs_apart(one: RunConfig, other: RunConfig) -> None:
    assert (one == other) == (one.config_hash == other.config_hash)


def test_hashes_of_earlier_runs_stay() -> None:
    """Runs from before there were gates and initial policies keep their hash, and their files still load."""
    config = RunConfig(task="toy", schema=SchemaConfig(alpha=2.0, beta=4e-4))
    assert config.config_hash == "cce214312d4520a1221024d2ac3d15ad2d404c9880ca351c0fe4378dfdbcb34b"
    data = msgspec.to_builtins(config)
    del data["safety_gate"], data["initial_policy"]
    assert parse_config(msgspec.json.encode(data)) == config


def test_defaults_are_the_papers() -> None:
    config = RunConfig(task="lateral-lifting")
    assert config.slots * config.episodes_per_slot == 200
    assert config.network.hidden == (64, 64, 64, 64)
    ppo = config.ppo
    assert (ppo.learning_rate, ppo.clip, ppo.entropy_coefficient, ppo.value_coefficient) == (
        0.001,
        0.2,
        0.01,
        0.5,
    )
    assert (ppo.max_gradient_norm, ppo.minibatches, ppo.epochs) == (0.5, 4, 4)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: RunConfig(task="toy", seed=-1), "seed"),
        (lambda: RunConfig(task="toy", slots=0), "slots"),
        (lambda: RunConfig(task="toy", initial_policy="runs/toy"), "initial_policy"),
        (lambda: RunConfig(task="toy", episodes_per_slot=0), "episodes_per_slot"),
        (lambda: PPOConfig(learning_rate=0.0), "learning_rate"),
        (lambda: PPOConfig(gamma=1.1), "gamma"),
        (lambda: PPOConfig(entropy_coefficient=-0.1), "entropy_coefficient"),
        (lambda: SchemaConfig(beta=float("inf")), "beta"),
        (lambda: NetworkConfig(hidden=()), "hidden"),
        (lambda: NetworkConfig(hidden=(64, 0)), "hidden"),
    ],
)
def test_bad_values_are_refused_by_name(make, field: str) -> None:
    with pytest.raises(ConfigError, match=f"{field!r} must be"):
        make()


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"{}",
        b"[]",
        b'{"task": 3}',
        b'{"task": "toy", "sed": 1}',
        b'{"task": "toy", "seed": -1}',
        b"\xff",
    ],
)
def test_bad_files_are_one_line(data: bytes) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_config(data)
    assert "\n" not in str(caught.value)


@given(st.binary(max_size=100))
def test_noise_is_no_config(data: bytes) -> None:
    with pytest.raises(ConfigError):
        parse_config(data)


def test_override() -> None:
    config = override(RunConfig(task="toy"), {"ppo.learning_rate": "0.005", "policy": "state", "slots": "7"})
    assert (config.ppo.learning_rate, config.policy, config.slots) == (0.005, "state", 7)
    with pytest.raises(UnknownNameError, match=r"Did you mean 'ppo.learning_rate'"):
        override(RunConfig(task="toy"), {"ppo.learning_rat": "1"})
    with pytest.raises(UnknownNameError):
        override(RunConfig(task="toy"), {"ppo": "1"})
    with pytest.raises(ConfigError):
        override(RunConfig(task="toy"), {"slots": "many"})
