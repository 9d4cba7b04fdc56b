"""Every task as a gymnasium environment, for learners other than this project's."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from taskschema.arrays import Float32Array
from taskschema.errors import ConfigError
from taskschema.tasks.registry import get_task
from taskschema.tasks.task import BatchEnvironment, Task

Action = dict[str, Any]
"""`{"pair": index into X, "arguments": [A] float32 in [-1, 1]}`."""


class TaskEnvironment(gymnasium.Env[Any, Action]):
    """One episode of a task at a time; `gymnasium.make("taskschema/Toy-v0")` makes one.

    An action names a skill pair and both arms' arguments, scaled so that [-1, 1] is the search space;
    those of skills that the pair does not use are ignored. Observations are in SI units, laid out as
    `layout` says. The reward is 1 at the first success, 0 otherwise (sparse and binary); the episode is
    terminated there, or after T steps.
    """

    def __init__(self, task: Task | str, obs_type: str = "state") -> None:
        self.metadata = {"render_modes": []}
        self.task = get_task(task) if isinstance(task, str) else task
        self.layout = self.task.observation
        """Fields of the observation, with units and meaning."""
        self.observation_space = observation_space(self.task, obs_type)
        self.action_space = action_space(self.task)
        self._environment: BatchEnvironment | None = None
        self._step = 0

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The |X| skill pairs by name, left arm first; `action["pair"]` is an index into them."""
        return self.task.pairs.pairs

    @property
    def argument_names(self) -> tuple[str, ...]:
        """The A arguments with their units, for example `left.reach.x [m]`."""
        return argument_names(self.task)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Float32Array, dict[str, Any]]:
        """Start an episode; the task instance comes from `self.np_random` alone."""
        super().reset(seed=seed, options=options)
        if self._environment is None:
            self._environment = build_environment(self.task)
        self._step = 0
        return self._environment.reset([self.np_random])[0].astype(np.float32), {}

    def step(self, action: Action) -> tuple[Float32Array, float, bool, bool, dict[str, Any]]:
        """Run one skill pair, both arms at the same time."""
        if self._environment is None:
            raise gymnasium.error.ResetNeeded("Call reset() before step().")
        arguments = self.task.pairs.to_si(np.asarray(action["arguments"])[None])
        result = self._environment.step(np.array([0]), np.array([int(action["pair"])]), arguments)
        self._step += 1
        success = bool(result.success[0]) and not bool(result.diverged[0])
        terminated = success or bool(result.diverged[0]) or self._step >= self.task.horizon
        info = {"is_success": success, "diverged": bool(result.diverged[0])}
        return result.observations[0].astype(np.float32), float(success), terminated, False, info

    def close(self) -> None:
        """Free threads and memory."""
        if self._environment is not None:
            self._environment.close()
            self._environment = None


def observation_space(task: Task, obs_type: str) -> spaces.Box:
    """Return the space of observations [D] in SI units.

    Raises:
        ConfigError: for a kind of observation that there is not.

    """
    if obs_type != "state":
        raise ConfigError(f"obs_type {obs_type!r} is not there yet: use obs_type='state'.")
    return spaces.Box(-np.inf, np.inf, (task.observation.size,), np.float32)


def action_space(task: Task) -> spaces.Dict:
    """Return the space of (skill pair, scaled arguments)."""
    return spaces.Dict(
        {
            "pair": spaces.Discrete(len(task.pairs)),
            "arguments": spaces.Box(-1.0, 1.0, (task.pairs.argument_count,), np.float32),
        }
    )


def argument_names(task: Task) -> tuple[str, ...]:
    """Return the names of the A arguments, each with its unit in brackets."""
    space = task.pairs
    return tuple(
        f"{name} [{argument.unit}]"
        for name, argument in zip(space.argument_names, space.arguments, strict=True)
    )


def build_environment(task: Task, threads: int = 1) -> BatchEnvironment:
    """Return the task's own environment; the simulator is imported only here."""
    from taskschema_worker.environments import make_environment

    return make_environment(task, threads=threads)
