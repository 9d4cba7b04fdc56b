"""Rollouts: an episode is a function of its key and of the policy, whatever shares its batch."""

import numpy as np
import pytest
from bus_setup import toy_snapshot
from hypothesis import given, settings
from hypothesis import strategies as st

from taskschema.arrays import FloatArray, IntArray
from taskschema.policies import Policy
from taskschema.tasks.task import StepResult
from taskschema.tasks.toy import Toy, ToyEnvironment
from taskschema.trajectory import Trajectory, encode_slot
from taskschema_worker.rollout import collect_slots

TOY = Toy()


def toy_policy(version: int = 0, seed: int = 0) -> Policy:
    return Policy(toy_snapshot(version, seed), TOY.pairs, TOY.observation)


def collect(
    slots: list[int], environment: ToyEnvironment | None = None, policy: Policy | None = None
) -> list[list[Trajectory]]:
    return collect_slots(
        environment or TOY.make_environment(),
        policy or toy_policy(),
        seed=3,
        round_index=5,
        slots=slots,
        episodes_per_slot=4,
        horizon=3,
    )


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 40), min_size=1, max_size=12, unique=True))
def test_slot_is_the_same_in_every_batch(slots: list[int]) -> None:
    together = collect(slots)
    for slot, trajectories in zip(slots, together, strict=True):
        assert encode_slot(trajectories) == encode_slot(collect([slot])[0])


def test_keys_and_shapes() -> None:
    (first, second) = collect([7, 2])
    assert [item.slot for item in first + second] == [7] * 4 + [2] * 4
    assert [item.episode for item in first] == [0, 1, 2, 3]
    assert {item.round for item in first + second} == {5}
    for item in first + second:
        assert item.observations.shape == (len(item), TOY.observation.size)
        assert item.observations.dtype == np.float32
        assert item.arguments.shape == (len(item), TOY.pairs.argument_count)
        assert item.success or len(item) == 3


class EventfulEnvironment(ToyEnvironment):
    """Episode i succeeds at step i; the last one diverges at its first step while claiming success."""

    def reset(self, generators: list[np.random.Generator]) -> FloatArray:
        self.count = len(generators)
        self.seen: list[list[int]] = []
        return super().reset(generators)

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        step = len(self.seen)
        self.seen.append(episodes.tolist())
        observations = super().step(episodes, pairs, arguments).observations
        diverged = episodes == self.count - 1
        success = (episodes == step) | diverged
        return StepResult(observations, success, diverged, physics_steps=10 * episodes)


def test_finished_episodes_leave_the_batch() -> None:
    environment = EventfulEnvironment(TOY)
    (trajectories,) = collect([0], environment)
    assert environment.seen == [[0, 1, 2, 3], [1, 2], [2]]
    assert [len(item) for item in trajectories] == [1, 2, 3, 1]
    assert [item.success for item in trajectories] == [True, True, True, False]
    assert [item.diverged for item in trajectories] == [False, False, False, True]
    assert [item.physics_steps for item in trajectories] == [0, 20, 60, 30]


def test_policy_acts_on_the_values_that_are_streamed() -> None:
    seen: list[np.ndarray] = []

    class Recording(Policy):
        def act(self, observations, step, generators):
            seen.append(observations.copy())
            return super().act(observations, step, generators)

    (trajectories,) = collect([0], policy=Recording(toy_snapshot(), TOY.pairs, TOY.observation))
    assert all(item.dtype == np.float32 for item in seen)
    np.testing.assert_array_equal(
        seen[0].view(np.uint32), np.stack([item.observations[0] for item in trajectories]).view(np.uint32)
    )


@pytest.mark.parametrize("changed", ["seed", "round_index", "slot", "policy"])
def test_every_part_of_the_key_matters(changed: str) -> None:
    settings_ = {"seed": 3, "round_index": 5}
    if changed in settings_:
        settings_[changed] += 1
    other = collect_slots(
        TOY.make_environment(),
        toy_policy(seed=1 if changed == "policy" else 0),
        slots=[1 if changed == "slot" else 0],
        episodes_per_slot=4,
        horizon=3,
        **settings_,
    )[0]
    original = collect([0])[0]
    assert any(
        not np.array_equal(left.arguments[0], right.arguments[0])
        for left, right in zip(original, other, strict=True)
    )
