"""Many episodes of a task at once, as gymnasium's vector environment."""

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from taskschema.arrays import AnyArray, BoolArray, FloatArray, IntArray
from taskschema.config import ObservationKind
from taskschema.tasks.registry import get_task
from taskschema.tasks.task import BatchEnvironment, Task
from taskschema_worker.gymnasium_action import Action, read_action
from taskschema_worker.gymnasium_environment import (
    action_space,
    argument_names,
    build_environment,
    observation_space,
)

Step = tuple[AnyArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]


@dataclass
class _Cohort:
    """Episodes that began together, in one batch environment, which resets only as a whole."""

    environment: BatchEnvironment
    members: IntArray
    """[m] which sub-environments they are; their place here is their index in the batch."""
    running: BoolArray
    """[m] whose episode is not over yet."""


class TaskVectorEnvironment(VectorEnv[Any, Action, Any]):
    """N episodes stepped together; `gymnasium.make_vec("taskschema/Toy-v0", num_envs=64)` makes one.

    Behaves like `SyncVectorEnv` over N environments with seeds `seed`, `seed + 1`, ...: a sub-environment
    whose episode is over starts a new one at the next step and ignores that step's action.
    """

    def __init__(
        self, task: Task | str, num_envs: int = 1, obs_type: ObservationKind = "state", threads: int = 1
    ) -> None:
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}
        self.task = get_task(task) if isinstance(task, str) else task
        self.num_envs = num_envs
        self.layout = self.task.observation
        """Fields of the observation, with units and meaning; of states."""
        self.obs_type = obs_type
        self.single_observation_space = observation_space(self.task, obs_type)
        self.single_action_space = action_space(self.task, obs_type)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._threads = threads
        self._generators: list[np.random.Generator] = []
        self._cohorts: list[_Cohort] = []
        self._spare: list[BatchEnvironment] = []
        space = self.single_observation_space
        self._observations: AnyArray = np.zeros((num_envs, *space.shape), dtype=space.dtype)
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._over = np.zeros(num_envs, dtype=bool)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The |X| skill pairs by name, left arm first."""
        return self.task.pairs.pairs

    @property
    def argument_names(self) -> tuple[str, ...]:
        """The A arguments with their units, for example `left.reach.x [m]`."""
        return argument_names(self.task, self.obs_type)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[AnyArray, dict[str, Any]]:
        """Start N episodes."""
        seeds = (
            seed
            if isinstance(seed, list)
            else [None if seed is None else seed + i for i in range(self.num_envs)]
        )
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments.")
        if not self._generators:
            self._generators = [seeding.np_random(item)[0] for item in seeds]
        else:
            self._generators = [
                old if item is None else seeding.np_random(item)[0]
                for old, item in zip(self._generators, seeds, strict=True)
            ]
        self._retire(self._cohorts)
        self._begin(self._every)
        return self._observations.copy(), {}

    def step(self, actions: Action) -> Step:
        """Run one skill pair in every episode, and start new episodes where the last one is over.

        Raises:
            InvalidAction: if there is no such pair, or an argument is not finite; nothing was run then.

        """
        if not self._generators:
            raise gymnasium.error.ResetNeeded("Call reset() before step().")
        resetting = self._over
        success = np.zeros(self.num_envs, dtype=bool)
        diverged = np.zeros(self.num_envs, dtype=bool)
        pairs, arguments = read_action(self.task.seen_pairs(self.obs_type), actions, ~resetting)
        for cohort in self._cohorts:
            local = np.flatnonzero(cohort.running)
            members = cohort.members[local]
            result = cohort.environment.step(local, pairs[members], arguments[members])
            self._observations[members] = result.observations
            diverged[members] = result.diverged
            success[members] = result.success & ~result.diverged
        self._steps += 1
        self._over = ~resetting & (success | diverged | (self._steps >= self.task.horizon))
        for cohort in self._cohorts:
            cohort.running &= ~self._over[cohort.members]
        self._retire([cohort for cohort in self._cohorts if not cohort.running.any()])
        if resetting.any():
            self._begin(np.flatnonzero(resetting))
        infos = {
            "is_success": success,
            "_is_success": ~resetting,
            "diverged": diverged,
            "_diverged": ~resetting,
        }
        never = np.zeros(self.num_envs, dtype=bool)
        return self._observations.copy(), success.astype(np.float64), self._over.copy(), never, infos

    def close_extras(self, **kwargs: object) -> None:
        """Free threads and memory."""
        self._retire(self._cohorts)
        for environment in self._spare:
            environment.close()
        self._spare.clear()

    @property
    def _every(self) -> IntArray:
        return np.arange(self.num_envs)

    def _begin(self, members: IntArray) -> None:
        """Start the members' next episodes as a cohort of their own."""
        environment = (
            self._spare.pop() if self._spare else build_environment(self.task, self._threads, self.obs_type)
        )
        self._observations[members] = environment.reset([self._generators[i] for i in members])
        self._steps[members] = 0
        self._cohorts.append(_Cohort(environment, members, np.ones(len(members), dtype=bool)))

    def _retire(self, cohorts: list[_Cohort]) -> None:
        """Keep the environments of cohorts that are over for later ones: T + 1 are the most there are."""
        for cohort in list(cohorts):
            self._cohorts.remove(cohort)
            self._spare.append(cohort.environment)
