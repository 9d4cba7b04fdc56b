"""`--agent robot`: the paper's settings for the robot (section IV-D), and a run that stays the robot's."""

import json

import pytest
from typer.testing import CliRunner

from taskschema.config import RunConfig
from taskschema.errors import RunFolderError, UnknownNameError
from taskschema_learner.cli.main import app
from taskschema_learner.cli.train import _agent_kind, _new_config
from taskschema_learner.composition import TrainOptions, open_folder
from taskschema_learner.default_config import default_config, robot_config


def test_the_papers_settings():
    config = robot_config(default_config("lateral-lifting"))
    # 500 steps in whole episodes of three: 500 / 3 = 166.7.
    assert (config.slots, config.episodes_per_slot) == (167, 1)
    assert config.ppo.learning_rate == 0.005
    assert (config.ppo.minibatches, config.ppo.epochs) == (10, 10)


def test_the_option_chooses_them():
    robot, simulation = (
        _new_config("opening", None, agent, runs_here=True) for agent in ("robot", "simulation")
    )
    assert robot == robot_config(default_config("opening"))
    assert simulation == default_config("opening")


def test_another_kind_of_agent_is_refused():
    with pytest.raises(UnknownNameError, match="simulation"):
        _agent_kind("robots")


@pytest.fixture
def robots_run(tmp_path):
    options = TrainOptions(RunConfig(task="toy"), tmp_path / "bar", agent="robot", device="cuda")
    return open_folder(options).path


def forget(run_dir):
    """Make the folder one from before it said whose it is."""
    path = run_dir / "config.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps({name: content[name] for name in content if name not in ("agent", "device")}))


def resumed(monkeypatch, run_dir, *words):
    """Return agent and device of `taskschema train --resume`."""
    given = []
    monkeypatch.setattr("taskschema_learner.cli.train._run", lambda options, kind: given.append(options))
    result = CliRunner().invoke(app, ["train", "--resume", "--run-dir", str(run_dir), *words])
    assert result.exit_code == 0, result.exception
    return given[0].agent, given[0].device


def test_a_robot_s_run_goes_on_as_one_without_being_told(monkeypatch, robots_run):
    assert resumed(monkeypatch, robots_run) == ("robot", "cuda")
    forget(robots_run)
    assert resumed(monkeypatch, robots_run) == ("simulation", "cpu")
    assert resumed(monkeypatch, robots_run, "--agent", "robot") == ("robot", "cpu")


def test_another_agent_or_device_does_not_go_on_with_a_run(robots_run):
    config = RunConfig(task="toy")
    with pytest.raises(RunFolderError, match="--agent robot: resume it without --agent simulation"):
        open_folder(TrainOptions(config, robots_run, resume=True, device="cuda"))
    with pytest.raises(RunFolderError, match="--device cuda: resume it without --device cpu"):
        open_folder(TrainOptions(config, robots_run, resume=True, agent="robot"))
    forget(robots_run)
    open_folder(TrainOptions(config, robots_run, resume=True, agent="robot"))
