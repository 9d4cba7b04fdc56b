"""What the learner promises: which parts each policy trains, order, restoring, determinism."""

import random
from dataclasses import replace

import msgspec
import numpy as np
import pytest
import torch
from toy_rounds import TOY, collect, train

from taskschema.config import PPOConfig, RunConfig, SchemaConfig
from taskschema.errors import ConfigError, SchemaMismatchError
from taskschema.policies import PolicySnapshot
from taskschema.schema import one_hot_logits
from taskschema.trajectory import Trajectory
from taskschema_learner.learner import Learner

SMALL = RunConfig(task="toy", slots=10)


def succeed(trajectory: Trajectory, steps: int = 2) -> Trajectory:
    """Make a trajectory end as a success after so many steps."""
    return replace(
        trajectory,
        observations=trajectory.observations[:steps],
        pairs=trajectory.pairs[:steps],
        arguments=trajectory.arguments[:steps],
        success=True,
    )


def with_successes(learner: Learner, config: RunConfig = SMALL) -> list[Trajectory]:
    """Return a round whose every third episode succeeded."""
    return [succeed(item) if n % 3 == 0 else item for n, item in enumerate(collect(learner, config))]


def sha_after_update(config: RunConfig, *, shuffle: int | None = None) -> str:
    learner = Learner(config, TOY)
    trajectories = with_successes(learner, config)
    if shuffle is not None:
        random.Random(shuffle).shuffle(trajectories)
    learner.update(trajectories)
    return learner.snapshot().sha256


def test_the_order_of_arrival_does_not_matter() -> None:
    assert len({sha_after_update(SMALL, shuffle=n) for n in (None, 1, 2)}) == 1


def test_a_version_is_copied_once_and_every_other_one_is_its_own() -> None:
    learner = Learner(SMALL, TOY)
    first, start = learner.snapshot(), learner.arrays()
    assert learner.snapshot() is first
    sha256 = first.sha256
    learner.update(with_successes(learner))
    assert learner.snapshot() is learner.snapshot()
    assert (learner.snapshot().version, learner.snapshot().sha256 != sha256) == (1, True)
    fresh = PolicySnapshot(first.version, dict(first.weights), first.logits)
    assert fresh.sha256 == sha256  # what was handed out has not changed
    learner.restore(start)
    assert (learner.snapshot().version, learner.snapshot().sha256) == (0, sha256)


def test_seeds_differ() -> None:
    other = msgspec.structs.replace(SMALL, seed=1)
    assert Learner(SMALL, TOY).snapshot().sha256 != Learner(other, TOY).snapshot().sha256


def test_first_snapshot_is_the_papers_start() -> None:
    snapshot = Learner(SMALL, TOY).snapshot()
    assert snapshot.version == 0
    assert snapshot.logits.shape == (3, 9)
    assert not snapshot.logits.any()


def test_schema_policy_trains_network_and_logits() -> None:
    learner = Learner(SMALL, TOY)
    before = learner.snapshot()
    statistics = learner.update(with_successes(learner))
    after = learner.snapshot()
    assert after.version == 1
    assert not np.array_equal(before.logits, after.logits)
    assert not np.array_equal(before.weights["mean.bias"], after.weights["mean.bias"])
    assert "pair.weight" not in after.weights
    assert all(np.isfinite(value) for value in vars(statistics).values())


def test_a_round_of_fewer_steps_than_minibatches_is_learned_from() -> None:
    config = RunConfig(task="toy", slots=1, episodes_per_slot=1, ppo=PPOConfig(minibatches=10))
    learner = Learner(config, TOY)
    before = learner.snapshot()
    statistics = learner.update(with_successes(learner, config))
    assert all(np.isfinite(value) for value in vars(statistics).values())
    after = learner.snapshot().weights
    # Advantages of minibatches of one are nothing when normalised, so that the critic alone moves.
    assert not np.array_equal(before.weights["value.weight"], after["value.weight"])


def test_ppo_never_touches_the_logits() -> None:
    frozen = SchemaConfig(frozen=True, initial_logits=tuple(tuple(range(9)) for _ in range(3)))
    learner = Learner(msgspec.structs.replace(SMALL, schema=frozen), TOY)
    start = learner.logits
    assert start.tolist() == [list(range(9))] * 3
    learner.update(with_successes(learner))
    assert np.array_equal(learner.logits, start)


def test_the_networks_gradient_does_not_depend_on_a_constant_added_to_the_logits() -> None:
    """The same trajectories under shifted logits give the same weights, bit for bit."""
    plain = Learner(SMALL, TOY)
    trajectories = with_successes(plain)
    shifted_config = SchemaConfig(initial_logits=tuple((7.5,) * 9 for _ in range(3)))
    shifted = Learner(msgspec.structs.replace(SMALL, schema=shifted_config), TOY)
    plain.update(trajectories)
    shifted.update(trajectories)
    for name, array in plain.snapshot().weights.items():
        assert np.array_equal(array, shifted.snapshot().weights[name])
    np.testing.assert_allclose(shifted.logits - plain.logits, 7.5)


def test_state_policy_trains_the_pair_head_and_not_the_logits() -> None:
    learner = Learner(msgspec.structs.replace(SMALL, policy="state"), TOY)
    before = learner.snapshot()
    learner.update(with_successes(learner))
    after = learner.snapshot()
    assert not after.logits.any()
    assert not np.array_equal(before.weights["pair.bias"], after.weights["pair.bias"])


def test_oracle_policy_keeps_the_papers_schema() -> None:
    learner = Learner(msgspec.structs.replace(SMALL, policy="oracle"), TOY)
    wanted = one_hot_logits(TOY.paper_pairs, 3, 9)
    assert np.array_equal(learner.logits, wanted)
    learner.update(with_successes(learner))
    assert np.array_equal(learner.logits, wanted)


@pytest.mark.parametrize("policy", ["schema", "oracle"])
def test_without_a_success_nothing_is_followed(policy: str) -> None:
    """Before the first reward the advantages are exactly 0: the mean arguments stay where they are."""
    learner = Learner(msgspec.structs.replace(SMALL, policy=policy), TOY)
    before = learner.snapshot().weights["mean.bias"]
    trajectories = [item for item in collect(learner, SMALL) if not item.success]
    learner.update(trajectories)
    assert np.array_equal(before, learner.snapshot().weights["mean.bias"])


def test_restored_learner_continues_bit_for_bit() -> None:
    first = Learner(SMALL, TOY)
    first.update(with_successes(first))
    saved = {name: array.copy() for name, array in first.arrays().items()}
    second = Learner(SMALL, TOY)
    second.restore(saved)
    assert second.snapshot().sha256 == first.snapshot().sha256
    assert second.used_steps == first.used_steps == 2
    for learner in (first, second):
        learner.update(with_successes(learner))
    assert second.snapshot().sha256 == first.snapshot().sha256
    assert all(np.array_equal(array, second.arrays()[name]) for name, array in first.arrays().items())


def test_restoring_before_the_first_update() -> None:
    first, second = Learner(SMALL, TOY), Learner(msgspec.structs.replace(SMALL, seed=4), TOY)
    second.restore(first.arrays())
    assert second.snapshot().sha256 == first.snapshot().sha256
    trajectories = with_successes(first)
    first.update(trajectories)
    assert first.version == 1


def test_restore_refuses_another_policys_arrays() -> None:
    state = Learner(msgspec.structs.replace(SMALL, policy="state"), TOY)
    with pytest.raises(ConfigError, match="does not fit"):
        Learner(SMALL, TOY).restore(state.arrays())
    arrays = Learner(SMALL, TOY).arrays()
    del arrays["adam.first"]
    with pytest.raises(ConfigError, match="does not fit"):
        Learner(SMALL, TOY).restore(arrays)


def test_update_refuses_another_round() -> None:
    learner = Learner(SMALL, TOY)
    trajectories = collect(learner, SMALL)
    learner.update(trajectories)
    with pytest.raises(ValueError, match="of that round"):
        learner.update(trajectories)
    with pytest.raises(ValueError, match="of that round"):
        learner.update([])


def test_an_update_to_weights_that_are_not_finite_is_refused() -> None:
    config = RunConfig(task="toy", slots=10, ppo=PPOConfig(learning_rate=1e38))
    with pytest.raises(ConfigError, match="lower ppo.learning_rate"):
        sha_after_update(config)


def test_used_steps_follow_the_recent_successes() -> None:
    learner = Learner(SMALL, TOY)
    assert learner.used_steps is None
    trajectories = collect(learner, SMALL)
    # 19 of 20 successes come at step 2, one at step 3: below a tenth, so row 3 is not needed
    learner.update([succeed(item, 3 if n == 0 else 2) for n, item in enumerate(trajectories[:20])])
    assert learner.used_steps == 2
    later = [succeed(replace(item, round=1), 3) for item in trajectories[:20]]
    learner.update(later)  # now 21 of 40
    assert learner.used_steps == 3


def test_bad_initial_logits_and_device_are_refused() -> None:
    schema = SchemaConfig(initial_logits=((0.0, 1.0),))
    with pytest.raises(SchemaMismatchError, match="shape"):
        Learner(msgspec.structs.replace(SMALL, schema=schema), TOY)
    with pytest.raises(ConfigError, match="cpu"):
        Learner(SMALL, TOY, device="tpu")
    if not torch.cuda.is_available():
        with pytest.raises(ConfigError, match="--device cpu"):
            Learner(SMALL, TOY, device="cuda")


def test_ppo_learns_the_arguments_of_a_given_schema() -> None:
    _, episodes = train(RunConfig(task="toy", policy="oracle"), rounds=60)
    assert episodes is not None


def test_reinforce_learns_the_arguments_of_a_given_schema() -> None:
    ppo = PPOConfig(algorithm="reinforce", learning_rate=0.002)
    _, episodes = train(RunConfig(task="toy", policy="oracle", ppo=ppo), rounds=100)
    assert episodes is not None


def test_algorithm1_finds_the_schema_from_scratch() -> None:
    learner, episodes = train(RunConfig(task="toy", seed=2), rounds=150)
    assert episodes is not None
    assert learner.used_steps is not None
