"""The benches that finish in seconds, at tiny sizes: they measure what they say."""

import msgspec
import numpy as np
import pytest
from bench import image_training, images, physics, publishing, seeds_result
from bench.fidelity import Agreement, together
from bench.recorded_rounds import Replay, record, worker_slots
from bench.reference_physics import blocks, perturbed_outcomes
from bus_setup import some_metrics
from rendering_setup import needs_renderer

from taskschema.config import RunConfig
from taskschema.kinematics.sawyer import sawyer
from taskschema.motion import ArmPath
from taskschema.tasks.registry import get_task
from taskschema_learner.experiment.cell import CellResult
from taskschema_learner.experiment.results_folder import ResultsFolder, Summary


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


def test_physics_entries(capsys):
    entries = physics.measure(repeats=1, episodes=4)
    shares = {entry.name: entry.value for entry in entries if "limits" in entry.name}
    assert all(0.5 < share <= 1.0 for share in shares.values())
    costs = [entry.value for entry in entries if entry.unit == "us"]
    assert len(costs) == 2
    assert costs[1] > costs[0] > 0


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


def test_seeds_that_did_not_reach_the_goal_are_left_out(tmp_path):
    facts = {"task": "lateral-lifting", "rounds": 2, "budget": 400, "config_hash": "", "sha256": ""}
    facts |= {"policy": "schema", "success_last_100": 0.9, "commit": ""}
    solved = CellResult(seed=0, state="solved", episodes=400, minutes=2.0, **facts)
    given_up = msgspec.structs.replace(solved, seed=1, state="not solved")
    oracle = msgspec.structs.replace(solved, policy="oracle")
    ResultsFolder(tmp_path).write(Summary(experiment="paper-sim", cells=(solved, given_up, oracle)))
    minutes, episodes = seeds_result.measure(1, tmp_path)
    assert (minutes.value, episodes.value) == (2.0, 400.0)
    assert seeds_result.measure(1, tmp_path / "nowhere") == []


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
def test_shares_of_images_are_of_all_the_time_and_every_slot_is_sent(capsys):
    images.rounds(slots=2, count=1)
    printed = capsys.readouterr().out
    rows = [line.split("|") for line in printed.splitlines() if line.startswith("| ")]
    shares = [row[2:4] for row in rows if row[1].strip() in images.PARTS]
    assert len(shares) == len(images.PARTS)
    for clock in range(2):
        assert sum(float(share[clock].strip(" %")) for share in shares) == pytest.approx(100.0, abs=0.4)
    # 4 episodes of 3 steps, 196,608 bytes each, if all of them fail
    assert "a slot has 2.36 MB" in printed
