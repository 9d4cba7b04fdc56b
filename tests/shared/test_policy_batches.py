"""Acting: an episode's action depends on nothing that shares its batch, to the bit."""

import numpy as np
import pytest
from bus_setup import TOY, toy_snapshot
from hypothesis import given, settings
from hypothesis import strategies as st

from taskschema.policies import Policy, PolicySnapshot
from taskschema.policies.network import LOG_STD_RANGE, forward
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.schema import one_hot_logits, softmax

POLICY = Policy(toy_snapshot(), TOY.pairs, TOY.observation)


def observations(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, TOY.observation.size)).astype(np.float32)


def streams(count: int, seed: int = 0) -> list[np.random.Generator]:
    return [generator(EpisodeKey(seed, 0, 0, episode), Purpose.ACTION) for episode in range(count)]


def bits(array: np.ndarray) -> bytes:
    return np.ascontiguousarray(array).tobytes()


@settings(max_examples=40, deadline=None)
@given(count=st.integers(1, 70), step=st.integers(0, 2), seed=st.integers(0, 1_000), data=st.data())
def test_actions_do_not_depend_on_the_batch(count: int, step: int, seed: int, data: st.DataObject) -> None:
    seen = observations(count, seed)
    together = POLICY.act(seen, step, streams(count))
    chosen = data.draw(st.lists(st.integers(0, count - 1), min_size=1, unique=True))
    part = POLICY.act(seen[chosen], step, [streams(count)[index] for index in chosen])
    assert bits(part.pairs) == bits(together.pairs[chosen])
    assert bits(part.raw) == bits(together.raw[chosen])
    assert bits(part.arguments) == bits(together.arguments[chosen])


@settings(max_examples=40, deadline=None)
@given(count=st.integers(1, 70), seed=st.integers(0, 1_000))
def test_mean_actions_do_not_depend_on_the_batch(count: int, seed: int) -> None:
    seen = observations(count, seed)
    together = POLICY.act_mean(seen, 0)
    for index in range(count):
        assert bits(POLICY.act_mean(seen[index : index + 1], 0).raw[0]) == bits(together.raw[index])


@pytest.mark.parametrize("size", [9, 64, 130])
def test_network_rows_do_not_depend_on_the_batch(size: int) -> None:
    """Also at the widths of other tasks, where BLAS chooses other kernels."""
    rng = np.random.default_rng(size)

    def layer(rows: int, columns: int) -> np.ndarray:
        return rng.standard_normal((rows, columns)).astype(np.float32) / 8

    weights = {"trunk.0.weight": layer(64, size), "trunk.0.bias": layer(1, 64)[0]}
    for index in range(1, 4):
        weights |= {f"trunk.{index}.weight": layer(64, 64), f"trunk.{index}.bias": layer(1, 64)[0]}
    for head, rows in (("mean", 28), ("log_std", 28), ("value", 1), ("pair", 64)):
        weights |= {f"{head}.weight": layer(rows, 64), f"{head}.bias": layer(1, rows)[0]}
    inputs = rng.standard_normal((200, size)).astype(np.float32)
    together = forward(weights, inputs)
    for count in (1, 2, 7, 64, 199):
        part = forward(weights, inputs[:count])
        for name, value in vars(part).items():
            assert bits(value) == bits(getattr(together, name)[:count]), (count, name)


def test_unused_arguments_are_zero_and_used_ones_inside_their_search_spaces() -> None:
    actions = POLICY.act(observations(500, 1), 0, streams(500))
    used = TOY.pairs.used[actions.pairs]
    assert (actions.raw[~used] == 0).all()
    assert (actions.raw[used] != 0).all()
    low = np.array([argument.low for argument in TOY.pairs.arguments])
    high = np.array([argument.high for argument in TOY.pairs.arguments])
    assert (actions.arguments >= low).all()
    assert (actions.arguments <= high).all()
    assert (np.abs(actions.raw) > 1).any(), "raw samples are not clipped"


def test_pairs_are_drawn_with_the_schemas_probabilities() -> None:
    count = 20_000
    drawn = POLICY.act(np.zeros((count, TOY.observation.size), np.float32), 1, streams(count)).pairs
    frequency = np.bincount(drawn, minlength=len(TOY.pairs)) / count
    probability = softmax(POLICY.snapshot.logits[1])
    deviation = np.sqrt(probability * (1 - probability) / count)
    assert (np.abs(frequency - probability) < 5 * deviation).all()


@pytest.mark.parametrize("pair", [0, 4, 8])
def test_impossible_pairs_are_never_drawn(pair: int) -> None:
    logits = one_hot_logits(np.array([pair, pair, pair]), 3, len(TOY.pairs))
    policy = Policy(PolicySnapshot(0, toy_snapshot().weights, logits), TOY.pairs, TOY.observation)
    assert set(policy.act(observations(1_000, 2), 2, streams(1_000)).pairs.tolist()) == {pair}


def test_noise_has_the_networks_mean_and_deviation() -> None:
    count = 20_000
    seen = np.repeat(observations(1, 3), count, axis=0)
    logits = one_hot_logits(np.array([0, 0, 0]), 3, len(TOY.pairs))
    policy = Policy(PolicySnapshot(0, toy_snapshot().weights, logits), TOY.pairs, TOY.observation)
    raw = policy.act(seen, 0, streams(count)).raw[:, TOY.pairs.used[0]]
    output = forward(toy_snapshot().weights, TOY.observation.to_network(seen[:1]))
    mean, deviation = output.mean[0, TOY.pairs.used[0]], np.exp(output.log_std[0, TOY.pairs.used[0]])
    assert (np.abs(raw.mean(axis=0) - mean) < 5 * deviation / np.sqrt(count)).all()
    np.testing.assert_allclose(raw.std(axis=0), deviation, rtol=0.03)


def test_log_standard_deviation_is_limited() -> None:
    weights = dict(toy_snapshot().weights)
    for bias, limit in ((-100.0, LOG_STD_RANGE[0]), (100.0, LOG_STD_RANGE[1])):
        weights["log_std.bias"] = np.full(TOY.pairs.argument_count, bias, dtype=np.float32)
        assert (forward(weights, observations(5, 4)).log_std == limit).all()


def test_state_policy_chooses_pairs_by_the_observation() -> None:
    weights = dict(toy_snapshot().weights)
    rng = np.random.default_rng(5)
    weights["pair.weight"] = 30 * rng.standard_normal((len(TOY.pairs), 64)).astype(np.float32)
    weights["pair.bias"] = np.zeros(len(TOY.pairs), dtype=np.float32)
    policy = Policy(PolicySnapshot(0, weights, toy_snapshot().logits), TOY.pairs, TOY.observation)
    assert len(set(policy.act_mean(observations(100, 6), 0).pairs.tolist())) > 2
    assert len(set(POLICY.act_mean(observations(100, 6), 0).pairs.tolist())) == 1
