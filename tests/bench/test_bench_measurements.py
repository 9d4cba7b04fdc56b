"""The benches that finish in seconds, at tiny sizes: they measure what they say."""

import time

import msgspec
import numpy as np
import pytest
from bench import image_training, images, learner_update, physics, publishing, seeds
from bench.fidelity import Agreement, together
from bench.recorded_rounds import Replay, record, worker_slots
from bench.reference_physics import blocks, perturbed_outcomes
from bus_setup import some_metrics
from rendering_setup import needs_renderer

from taskschema.config import RunConfig
from taskschema.kinematics.sawyer import sawyer
from taskschema.motion import ArmPath
from taskschema.tasks.registry import get_task
from taskschema_learner.networks.initial_weights import initial_weights


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record(tmp_path_factory.mktemp("recorded"), 2, 2, RunConfig(task="lateral-lifting", slots=4))


def test_replay_ends_where_the_recorded_physics_ended(recorded):
    replay = Replay(recorded, [0, 1], worker=0, workers=2)
    assert replay.physics_steps > 5_000
    last = replay()
    # The last stretch starts where the one before left its episode, which only the same physics reaches.
    with recorded.stretches(1, 0) as file:
        count = int(file["count"])
        before, after = count - 2, count - 1
        episode = file[f"episodes{after}"][-1]
        row = int(np.flatnonzero(file[f"episodes{before}"] == episode)[0])
        start = file[f"initial{after}"][-1]
    shortened = Replay(recorded, [1], worker=0, workers=2)
    shortened._calls = [
        (models[row : row + 1], initial[row : row + 1], controls[row : row + 1], warmstart[row : row + 1])
        for models, initial, controls, warmstart in shortened._calls[before : before + 1]
    ]
    np.testing.assert_array_equal(shortened()[1:], start[1:])
    assert not np.array_equal(last[1:], start[1:])


def test_recorded_rounds_are_those_of_the_run(recorded):
    assert recorded.snapshot(1).sha256 == recorded.sha256[0]
    assert recorded.sha256[0] != recorded.sha256[1]


def test_workers_share_all_slots():
    config = RunConfig(task="lateral-lifting")
    slots = [slot for worker in range(3) for slot in worker_slots(config, worker, 3)]
    assert slots == list(range(50))


def test_limits_are_taken_from_the_set_points_themselves():
    limit, acceleration = sawyer().velocity, sawyer().acceleration
    # Half a second at half the acceleration limit of joint 0 reaches 0.5 * 10 * 0.5 = 2.5 of 1.74 rad/s.
    times = np.linspace(0.0, 0.5, 51)
    joints, velocities = np.zeros((1, 51, 7)), np.zeros((1, 51, 7))
    joints[0, :, 0], velocities[0, :, 0] = 0.25 * acceleration[0] * times**2, 0.5 * acceleration[0] * times
    path = ArmPath(times[None, :], joints, velocities, np.zeros((1, 51)))
    speed, _ = physics.shares_of_limits(path)
    assert speed == pytest.approx(0.5 * acceleration[0] * 0.5 / limit[0], rel=0.01)


def test_limits_are_compared_for_every_skill_in_every_task_that_has_it():
    moved = [each.skill for each in physics.random_motions(get_task("rotating"), episodes=2)]
    assert moved == ["side_grasp", "go_to_pose", "rotate"]


def test_physics_entries(capsys):
    entries = physics.measure(repeats=1, episodes=4)
    steps = {entry.name.split(",")[0] for entry in entries if not entry.unit}
    assert steps == {
        "lateral-lifting: steps of 8 ms of top_grasp",
        "lateral-lifting: steps of 8 ms of lift",
        "picking: steps of 2 ms of go_to_pose",
        "opening: steps of 4 ms of side_grasp",
        "opening: steps of 4 ms of twist",
        "rotating: steps of 8 ms of rotate",
    }
    shares = {entry.name: entry.value for entry in entries if "limits" in entry.name}
    assert all(0.5 < share <= 1.0 for share in shares.values())
    costs = [entry.value for entry in entries if entry.unit == "us"]
    assert len(costs) == 2
    assert costs[1] > costs[0] > 0


def test_both_timed_updates_do_the_same():
    rng, batch = np.random.default_rng(0), learner_update.make_batch()
    start = initial_weights(
        rng, learner_update.OBSERVATIONS, learner_update.NETWORK, learner_update.ARGUMENTS
    )
    first, second, other = (learner_update.one_pair(start, batch, seed) for seed in (1, 1, 2))
    ours, theirs = first.weights
    for name, array in ours.items():
        # In single precision the rounding of sixteen steps of Adam remains.
        assert np.abs(array - theirs[name]).mean() < 0.01 * np.abs(array - start[name]).mean(), name
        np.testing.assert_array_equal(array, second.weights[0][name])
        assert not np.array_equal(array, other.weights[0][name])


def test_publishing_reaches_a_real_worker():
    median, tail = publishing.measure(repeats=1, publishes=5)
    assert 0 < median.value <= tail.value


def test_the_perturbed_expert_is_seeded_by_episode():
    task = get_task("lateral-lifting")
    together_, apart = (
        perturbed_outcomes(task, None, range(12), 1),
        [perturbed_outcomes(task, None, [episode], 1)[0] for episode in (3, 7)],
    )
    assert [together_[3], together_[7]] == apart
    assert 0 < together_.mean() < 1


def test_agreement_counts_outcomes_and_rates():
    parts = [
        Agreement(np.array([True, False]), np.array([True, True]), np.array([True, True])),
        Agreement(np.array([True, False]), np.array([False, False]), np.array([False, True])),
    ]
    whole = together(parts)
    assert whole.same_outcome == 50.0
    assert whole.rate_difference == 0.0
    assert whole.same_in_references == 75.0
    assert parts[0].rate_difference == 50.0
    assert blocks(5, 2) == [range(0, 2), range(2, 4), range(4, 5)]


def test_seeds_that_did_not_reach_the_goal_are_left_out(monkeypatch):
    successes = {0: 0.93, 1: 0.4, 2: 0.9}

    def train(task, seed, rounds):
        last = msgspec.structs.replace(
            some_metrics(seed), episodes=1_000 * (seed + 1), success_last_100=successes[seed]
        )
        return 1.0 + seed, last

    monkeypatch.setattr(seeds, "train", train)
    minutes, episodes = seeds.measure(3)
    assert (minutes.name, minutes.value) == ("`make train` to 90 %, median of 2 of 3 seeds", 2.0)
    assert episodes.value == 2_000.0
    assert seeds.measure(1)[0].name == "`make train` to 90 %, median of 1 seeds"
    successes[0] = 0.1
    assert seeds.measure(1) == []


def test_a_seed_is_timed_from_the_command_to_its_end():
    started = time.monotonic()
    minutes, last = seeds.train("toy", seed=0, rounds=2)
    assert (last.round, last.episodes) == (1, 400)
    rounds = last.seconds_collect + last.seconds_update + last.seconds_checkpoint
    assert rounds + 1.0 < 60 * minutes < time.monotonic() - started  # Ray alone takes seconds to start


def test_a_training_on_images_is_measured_from_its_second_round_on():
    first, second, third = (
        msgspec.structs.replace(
            some_metrics(number),
            steps=steps,
            seconds_collect=collecting,
            seconds_update=4.0,
            seconds_checkpoint=0.5,
        )
        for number, steps, collecting in ((0, 600, 99.0), (1, 1_100, 5.5), (2, 1_700, 5.5))
    )
    # 1,100 steps in 2 x (5.5 + 4 + 0.5) = 20 s
    assert image_training.row(2, [first, second, third]) == "| 2 | 55.0 | 10.0 | 55% | 40% | 5% |"


@needs_renderer
def test_shares_of_images_are_of_all_the_time_and_every_slot_is_sent():
    lines = images.rounds(slots=2, count=1)
    rows = [line.split("|") for line in lines if line.startswith("| ")]
    shares = [row[2:4] for row in rows if row[1].strip() in images.PARTS]
    assert len(shares) == len(images.PARTS)
    for clock in range(2):
        assert sum(float(share[clock].strip(" %")) for share in shares) == pytest.approx(100.0, abs=0.4)
    # 4 episodes of 3 steps, 196,608 bytes each, if all of them fail
    assert "A slot has 2.36 MB" in "\n".join(lines)
