"""Every task as a gymnasium environment, for learners other than this project's."""

from typing import Any, get_args

import gymnasium
import numpy as np
from gymnasium import spaces

from taskschema.arrays import AnyArray
from taskschema.config import ObservationKind
from taskschema.errors import UnknownNameError
from taskschema.frames import FRAME_SHAPE
from taskschema.tasks.registry import get_task
from taskschema.tasks.task import BatchEnvironment, Task
from taskschema_worker.gymnasium_action import Action, read_action


class TaskEnvironment(gymnasium.Env[Any, Action]):
    """One episode of a task at a time; `gymnasium.make("taskschema/Toy-v0")` makes one.

    An action names a skill pair and both arms' arguments, scaled so that [-1, 1] is the search space;
    those of skills that the pair does not use are ignored. Observations are in SI units, laid out as
    `layout` says; with `obs_type="image"` they are the overhead camera's frames and nothing else, and
    positions are locations on the table. The reward is 1 at the first success, 0 otherwise (sparse and
    binary); the episode is terminated there, or after T steps.
    """

    def __init__(self, task: Task | str, obs_type: ObservationKind = "state") -> None:
        self.metadata = {"render_modes": []}
        self.task = get_task(task) if isinstance(task, str) else task
        self.obs_type = obs_type
        self.layout = self.task.observation
        """Fields of the observation, with units and meaning; of states."""
        self.observation_space = observation_space(self.task, obs_type)
        self.action_space = action_space(self.task, obs_type)
        self._environment: BatchEnvironment | None = None
        self._step = 0

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The |X| skill pairs by name, left arm first; `action["pair"]` is an index into them."""
        return self.task.pairs.pairs

    @property
    def argument_names(self) -> tuple[str, ...]:
        """The A arguments with their units, for example `left.reach.x [m]`."""
        return argument_names(self.task, self.obs_type)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[AnyArray, dict[str, Any]]:
        """Start an episode; the task instance comes from `self.np_random` alone."""
        super().reset(seed=seed, options=options)
        if self._environment is None:
            self._environment = build_environment(self.task, observation=self.obs_type)
        self._step = 0
        first = self._environment.reset([self.np_random])[0]
        return first.astype(self.observation_space.dtype, copy=False), {}

    def step(self, action: Action) -> tuple[AnyArray, float, bool, bool, dict[str, Any]]:
        """Run one skill pair, both arms at the same time.

        Raises:
            InvalidAction: if there is no such pair, or an argument is not finite.

        """
        if self._environment is None:
            raise gymnasium.error.ResetNeeded("Call reset() before step().")
        pair, arguments = read_action(self.task.seen_pairs(self.obs_type), action, np.array(True))
        result = self._environment.step(np.array([0]), pair[None], arguments[None])
        self._step += 1
        success = bool(result.success[0]) and not bool(result.diverged[0])
        terminated = success or bool(result.diverged[0]) or self._step >= self.task.horizon
        info = {"is_success": success, "diverged": bool(result.diverged[0])}
        observation = result.observations[0].astype(self.observation_space.dtype, copy=False)
        return observation, float(success), terminated, False, info

    def close(self) -> None:
        """Free threads and memory."""
        if self._environment is not None:
            self._environment.close()
            self._environment = None


def observation_space(task: Task, obs_type: ObservationKind) -> spaces.Box:
    """Return the space of observations [D] in SI units, or of frames [256, 256, 3].

    Raises:
        UnknownNameError: for a kind of observation that there is not.

    """
    if obs_type not in get_args(ObservationKind):
        raise UnknownNameError("obs_type", obs_type, get_args(ObservationKind))
    if obs_type == "image":
        return spaces.Box(0, 255, FRAME_SHAPE, np.uint8)
    return spaces.Box(-np.inf, np.inf, (task.observation.size,), np.float32)


def action_space(task: Task, obs_type: ObservationKind) -> spaces.Dict:
    """Return the space of (skill pair, scaled arguments)."""
    size = task.seen_pairs(obs_type).argument_count
    return spaces.Dict(
        {
            "pair": spaces.Discrete(len(task.pairs)),
            "arguments": spaces.Box(-1.0, 1.0, (size,), np.float32),
        }
    )


def argument_names(task: Task, obs_type: ObservationKind) -> tuple[str, ...]:
    """Return the names of the A arguments, each with its unit in brackets."""
    space = task.seen_pairs(obs_type)
    return tuple(
        f"{name} [{argument.unit}]"
        for name, argument in zip(space.argument_names, space.arguments, strict=True)
    )


def build_environment(
    task: Task, threads: int = 1, observation: ObservationKind = "state"
) -> BatchEnvironment:
    """Return the task's own environment; the simulator is imported only here."""
    from taskschema_worker.environments import make_environment
    from taskschema_worker.image_environment import ImageEnvironment

    environment = make_environment(task, threads, observation)
    if isinstance(environment, ImageEnvironment):
        environment.sees_the_end = True  # gymnasium's users get an observation after the last step, too
    return environment
