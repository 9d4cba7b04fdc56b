"""`--agent robot`: the paper's settings for the robot (section IV-D), and no workers."""

import pytest

from taskschema.errors import UnknownNameError
from taskschema_learner.cli.train import _agent_kind, _new_config
from taskschema_learner.default_config import default_config, robot_config


def test_the_papers_settings():
    config = robot_config(default_config("lateral-lifting"))
    # 500 steps in whole episodes of three: 500 / 3 = 166.7.
    assert (config.slots, config.episodes_per_slot) == (167, 1)
    assert config.ppo.learning_rate == 0.005
    assert (config.ppo.minibatches, config.ppo.epochs) == (10, 10)


def test_the_option_chooses_them():
    assert _new_config("opening", None, "robot") == robot_config(default_config("opening"))
    assert _new_config("opening", None, "simulation") == default_config("opening")


def test_another_kind_of_agent_is_refused():
    with pytest.raises(UnknownNameError, match="simulation"):
        _agent_kind("robots")
