"""Confidence intervals, held-out episodes and exports."""

import json

import msgspec
import numpy as np
import pytest

from taskschema.config import RunConfig
from taskschema.errors import ConfigError, RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema.tasks.registry import get_task
from taskschema_learner.evaluation import HELD_OUT, evaluate, held_out_episodes, wilson
from taskschema_learner.learner import Learner
from taskschema_learner.runs.export import write_trajectories
from taskschema_learner.runs.recomputation import RecomputedRound, recompute
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.runs.run_policies import newest_policy
from taskschema_learner.runs.verification import training_episodes, verify


def metrics(number):
    """A row of a round, in which nothing but its number means anything."""
    values = {
        field.name: {int: number, float: 0.0, str: ""}.get(field.type, (0.0,))
        for field in msgspec.structs.fields(RoundMetrics)
    }
    return RoundMetrics(**values)


@pytest.fixture
def folder(tmp_path):
    config = RunConfig(task="toy", seed=5, slots=3, policy="oracle")
    folder = RunFolder.create(tmp_path / "run", config)
    folder.write_policy(Learner(config, get_task("toy")).snapshot().to_bytes())
    return folder


def test_wilson_intervals_are_those_of_the_formula():
    # p = 0.9, n = 100, z^2 = 3.8415: center (0.9 + 0.0192) / 1.0384 = 0.8852,
    # half-width 1.96 * sqrt(0.0009 + 0.000096) / 1.0384 = 0.0596.
    rate = wilson(90, 100)
    assert (rate.low, rate.high) == pytest.approx((0.8256, 0.9448), abs=2e-4)
    # No success in 10: the upper end is z^2 / (n + z^2) = 3.8415 / 13.8415 = 0.2775.
    none = wilson(0, 10)
    assert (none.low, none.high) == (0.0, pytest.approx(0.2775, abs=1e-4))
    assert wilson(10, 10).high == pytest.approx(1.0)


def test_held_out_instances_are_never_trained_on(folder):
    held_out = held_out_episodes(folder, newest_policy(folder), 12, mean=False)
    trained = next(recompute(folder.config, 1)).trajectories
    first = {item.observations[0].tobytes() for item in held_out}
    assert len(first) == 12
    assert first.isdisjoint(item.observations[0].tobytes() for item in trained)
    assert folder.config.seed + HELD_OUT >= 2**63  # no run has such a seed


def test_both_kinds_of_actions_see_the_same_instances_and_differ(folder):
    snapshot = newest_policy(folder)
    sampled = held_out_episodes(folder, snapshot, 6, mean=False)
    mean = held_out_episodes(folder, snapshot, 6, mean=True)
    for one, other in zip(sampled, mean, strict=True):
        np.testing.assert_array_equal(one.observations[0], other.observations[0])
        assert not np.array_equal(one.arguments[0], other.arguments[0])
    again = held_out_episodes(folder, snapshot, 6, mean=True)
    for one, other in zip(mean, again, strict=True):
        np.testing.assert_array_equal(one.arguments, other.arguments)
    found = evaluate(folder, 6)
    assert found.sampled.episodes == found.mean.episodes == 6


def test_a_damaged_policy_is_one_clear_error(folder):
    path = folder.path / "policy.safetensors"
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(RunFolderError, match="damaged"):
        evaluate(folder, 1)


def test_training_episodes_are_the_run_s_own_or_none(folder):
    expected = list(recompute(folder.config, 2))
    rows = [msgspec.structs.replace(metrics(each.round), sha256=each.sha256) for each in expected]
    folder.keep_metrics(rows)
    found = training_episodes(folder, 9)
    assert [item.round for item in found] == [0] * 12 + [1] * 12
    assert all(
        np.array_equal(one.arguments, other.arguments)
        for one, other in zip(found, [item for each in expected for item in each.trajectories], strict=True)
    )
    folder.keep_metrics([rows[0], msgspec.structs.replace(rows[1], sha256="0" * 64)])
    assert len(training_episodes(folder, 1)) == 12
    with pytest.raises(RunFolderError, match="Round 1 of run comes out differently here"):
        training_episodes(folder, 2)


def test_a_run_is_computed_again_on_the_device_that_it_learned_on(monkeypatch, tmp_path):
    folder = RunFolder.create(tmp_path / "graphics", RunConfig(task="toy"), device="cuda")
    folder.append_metrics(metrics(0))
    devices = []

    def recompute_nothing(config, rounds, trunk, initial_policy, device):
        devices.append(device)
        return [RecomputedRound(0, [], "ab")]

    monkeypatch.setattr("taskschema_learner.runs.verification.recompute", recompute_nothing)
    assert not verify(folder).same
    assert devices == ["cuda"]


def test_exports_hold_what_was_executed(folder, tmp_path):
    task = get_task("toy")
    trajectories = held_out_episodes(folder, newest_policy(folder), 4, mean=False)
    write_trajectories(tmp_path / "x.npz", task, trajectories)
    write_trajectories(tmp_path / "x.jsonl", task, trajectories)
    with np.load(tmp_path / "x.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["length"], [len(item) for item in trajectories])
        item, steps = trajectories[0], len(trajectories[0])
        np.testing.assert_array_equal(arrays["observations"][0, :steps], item.observations)
        np.testing.assert_array_equal(arrays["pairs"][0, steps:], -1)
        expected = np.where(task.pairs.used[item.pairs], task.pairs.to_si(item.arguments), 0)
        np.testing.assert_array_equal(arrays["arguments"][0, :steps], expected)
        assert arrays["argument_names"][0] == "left.reach.x [m]"
    lines = [json.loads(line) for line in (tmp_path / "x.jsonl").read_text().splitlines()]
    assert [len(line["steps"]) for line in lines] == [len(item) for item in trajectories]
    first = lines[0]["steps"][0]
    assert (first["left"], first["right"]) == ("reach", "reach")  # the oracle's first pair
    assert first["arguments"]["left.reach.x [m]"] == expected[0, 0]
    with pytest.raises(ConfigError, match=r"\.npz or \.jsonl"):
        write_trajectories(tmp_path / "x.pkl", task, trajectories)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run", "x.jsonl", "x.npz"]
