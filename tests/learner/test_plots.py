"""Learning-curve pictures."""

import re

import numpy as np
import pytest

from taskschema.config import RunConfig, override
from taskschema.errors import RunFolderError
from taskschema.metrics import RoundMetrics
from taskschema.schema import SchemaView
from taskschema.tasks.registry import get_task
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.views.plots import Curve, average, labels_of, plot_run, plot_runs


def row(number, success):
    return RoundMetrics(
        round=number,
        policy_version=number + 1,
        episodes=200 * (number + 1),
        steps=600 * (number + 1),
        physics_steps=0,
        diverged=0,
        quarantined=0,
        success_rate=success,
        success_last_100=success,
        schema_entropy=(1.0, 1.0, 1.0),
        schema_probability=(success, success / 2, 1 / 9),
        policy_loss=0.0,
        value_loss=0.0,
        argument_entropy=0.0,
        approximate_kl=0.0,
        clip_fraction=0.0,
        gradient_norm=0.0,
        seconds_collect=0.0,
        seconds_update=0.0,
        seconds_checkpoint=0.0,
        sha256="0" * 64,
    )


@pytest.fixture
def make_run(tmp_path):
    def make(name, seed=0, policy="schema", rounds=30, speed=1.0):
        config = RunConfig(task="toy", seed=seed, policy=policy)
        folder = RunFolder.create(tmp_path / name, config)
        for number in range(rounds):
            folder.append_metrics(row(number, float(1 / (1 + np.exp(-(number * speed - 15) / 3)))))
        task = get_task("toy")
        view = SchemaView(task.pairs, np.zeros((task.horizon, len(task.pairs))))
        folder.write_schema(view.document(run=name, task="toy", version=3, used_steps=2, updated_at=""))
        return folder

    return make


def is_picture(path):
    data = path.read_bytes()
    return data.startswith(b"\x89PNG") and len(data) > 10_000


def test_one_run_becomes_a_picture(make_run, tmp_path):
    for policy in ("schema", "state"):
        plot_run(make_run(policy, policy=policy), tmp_path / f"{policy}.png")
        assert is_picture(tmp_path / f"{policy}.png")


def test_several_runs_become_one_picture(make_run, tmp_path):
    runs = [make_run(f"schema-{seed}", seed=seed, rounds=25 + seed, speed=1 + seed / 5) for seed in range(3)]
    runs += [make_run(f"state-{seed}", seed=seed, policy="state", rounds=40, speed=0.5) for seed in range(2)]
    plot_runs(runs, tmp_path / "all.png")
    assert is_picture(tmp_path / "all.png")


def test_runs_that_differ_in_more_than_their_seeds_have_labels_of_their_own():
    plain = RunConfig(task="toy", seed=1)
    faster = override(plain, {"ppo.learning_rate": "0.005", "seed": "2"})
    gated = override(plain, {"safety_gate": "true", "initial_policy": "ab" * 32})
    given = override(plain, {"schema.initial_logits": "[[0.0, 1.0], [1.0, 0.0]]"})
    assert labels_of(
        [plain, override(plain, {"seed": "7"}), given, override(plain, {"policy": "state"})]
    ) == [
        "toy, schema",
        "toy, schema",
        "toy, schema, given schema",
        "toy, state",
    ]
    rest = "ppo.learning_rate {}, safety_gate {}, initial_policy {}"
    assert labels_of([plain, faster, gated]) == [
        "toy, schema, " + rest.format("0.001", "false", "none"),
        "toy, schema, " + rest.format("0.005", "false", "none"),
        "toy, schema, " + rest.format("0.001", "true", "abababab"),
    ]
    others = [given, override(given, {"schema.initial_logits": "[[0.0, 2.0], [1.0, 0.0]]"})]
    labels = labels_of(others)
    assert len({*labels}) == 2
    assert all(
        re.fullmatch("toy, schema, given schema, schema.initial_logits [0-9a-f]{8}", x) for x in labels
    )


def test_averages_are_those_computed_by_hand():
    # First run: 0 to 0.4 over 100 episodes, then over; second: 0 to 0.8 over 200 episodes.
    # At 100: (0.4 + 0.4) / 2 = 0.4; at 200: (0.4 held + 0.8) / 2 = 0.6, between 0.4 and 0.8.
    first = Curve("a", np.array([100.0]), np.array([0.4]))
    second = Curve("a", np.array([200.0]), np.array([0.8]))
    grid, mean, low, high = average([first, second], 200.0)
    middle = np.argmin(np.abs(grid - 100.0))
    assert mean[middle] == pytest.approx(0.4, abs=0.01)
    assert (mean[-1], low[-1], high[-1]) == pytest.approx((0.6, 0.4, 0.8))


def test_a_run_without_rounds_cannot_be_drawn(make_run, tmp_path):
    with pytest.raises(RunFolderError, match="no rounds"):
        plot_run(make_run("empty", rounds=0), tmp_path / "no.png")
    assert not (tmp_path / "no.png").exists()


def test_a_picture_that_cannot_be_written_is_one_clear_error(make_run, tmp_path):
    with pytest.raises(RunFolderError, match="cannot be written"):
        plot_run(make_run("run"), tmp_path / "missing" / "curve.png")
