"""A toy with as many lucky schemas, which never pass 20 %, as good ones: may a run be caught by one?"""

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.tasks.task import StepResult
from taskschema.tasks.toy import Toy, ToyEnvironment

TRAP_SHARE = 0.2


class TrapEnvironment(ToyEnvironment):
    """The toy, but a bar whose two handles were not grasped in the first step slips in 80 % of episodes."""

    def reset(self, generators: list[np.random.Generator]) -> FloatArray:
        observations = super().reset(generators)
        self._slips = np.array([rng.random() >= TRAP_SHARE for rng in generators])
        self._late = np.zeros(len(generators), dtype=bool)
        return observations

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        first = self._time[episodes] == 0
        self._late[episodes] |= first & (pairs != self._task.paper_pairs[0])
        result = super().step(episodes, pairs, arguments)
        success = result.success & ~(self._late & self._slips)[episodes]
        return StepResult(result.observations, success, result.diverged, result.physics_steps)


class TrapToy(Toy):
    """The toy with traps."""

    name = "toy-trap"

    def make_environment(self, threads: int = 1) -> TrapEnvironment:
        return TrapEnvironment(self)
