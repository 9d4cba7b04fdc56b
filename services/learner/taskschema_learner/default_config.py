"""The config of a task with all defaults."""

import math

import msgspec

from taskschema.config import PolicyKind, RunConfig
from taskschema.tasks.registry import task_of

STEPS_PER_SLOT = 10
"""A slot holds whole episodes of at least this many steps, if none succeeds early (paper: 10)."""


def default_config(
    task: str, policy: PolicyKind = "schema", seed: int = 0, *, task_source: str | None = None
) -> RunConfig:
    """Return the config that a run of this task has if nothing else is said.

    Raises:
        TaskschemaError: if there is no such task, or its file does not load.

    """
    config = RunConfig(task=task, policy=policy, seed=seed, task_source=task_source)
    episodes = math.ceil(STEPS_PER_SLOT / task_of(config).horizon)
    return msgspec.structs.replace(config, episodes_per_slot=episodes)


ROBOT_STEPS = 500
"""Steps between two updates on the robot (paper)."""


def robot_config(config: RunConfig) -> RunConfig:
    """Return a config with the paper's settings for the robot (section IV-D).

    167 slots of one whole episode each stand for its 500 steps; with one robot nothing is gained by more
    episodes a slot, and each is delivered as soon as it is over.
    """
    ppo = msgspec.structs.replace(config.ppo, learning_rate=0.005, minibatches=10, epochs=10)
    slots = math.ceil(ROBOT_STEPS / task_of(config).horizon)
    return msgspec.structs.replace(config, slots=slots, episodes_per_slot=1, ppo=ppo)
