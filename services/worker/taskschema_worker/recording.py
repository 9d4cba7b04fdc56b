"""Episodes with every state of their motion, for pictures."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from taskschema.arrays import FloatArray, IntArray
from taskschema.tasks.scene_task import ObjectInstance, SceneTask
from taskschema.tasks.task import StepResult
from taskschema_worker.plan_gate import PlanGate
from taskschema_worker.scene_environment import SceneEnvironment
from taskschema_worker.seen_scene_environment import SeenSceneEnvironment


@dataclass
class RecordedStep:
    """One step of an episode: what both arms ran, and how everything moved."""

    left: str
    """Skill of the left arm."""
    right: str
    """Skill of the right arm."""
    positions: list[FloatArray] = field(default_factory=list)
    """`qpos` [nq] after every physics step; none if the step took no time."""


@dataclass
class RecordedEpisode:
    """One episode from its start to its end."""

    instance: ObjectInstance
    start: FloatArray
    """`qpos` [nq] before the first step."""
    timestep: float
    """Between two states [s]."""
    steps: list[RecordedStep] = field(default_factory=list)
    success: bool = False


class RecordingEnvironment(SceneEnvironment):
    """A scene environment that remembers its episodes' motion; results are those of any other."""

    def __init__(self, task: SceneTask, threads: int = 1, *, gate: PlanGate | None = None) -> None:
        super().__init__(task, threads, gate=gate)
        self._names = task.pairs.pairs
        self.episodes: list[RecordedEpisode] = []
        """Everything since it was made, in the order of resets."""
        self._current: list[RecordedEpisode] = []
        self._simulation.watcher = self._note

    def reset_to(self, instances: Sequence[ObjectInstance]) -> FloatArray:
        """Start one episode per instance, and to record it."""
        observations = super().reset_to(instances)
        starts = self._simulation.positions.copy()
        self._current = [
            RecordedEpisode(instance, start, self.timestep)
            for instance, start in zip(instances, starts, strict=True)
        ]
        self.episodes += self._current
        return observations

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        """Run one step of the episodes [M], and record it."""
        for episode, pair in zip(episodes, pairs, strict=True):
            self._current[episode].steps.append(RecordedStep(*self._names[pair]))
        result = super().step(episodes, pairs, arguments)
        for episode, success in zip(episodes, result.success, strict=True):
            self._current[episode].success |= bool(success)
        return result

    def _note(self, episodes: IntArray, positions: FloatArray) -> None:
        """Keep the motion [M, S, nq] of the episodes [M]."""
        for episode, motion in zip(episodes, positions, strict=True):
            self._current[episode].steps[-1].positions.extend(motion.copy())


class SeenRecordingEnvironment(RecordingEnvironment, SeenSceneEnvironment):
    """The same, with the overhead camera that policies on images see through."""

    def __init__(
        self,
        task: SceneTask,
        threads: int = 1,
        *,
        randomise_visuals: bool = False,
        gate: PlanGate | None = None,
    ) -> None:
        super().__init__(task, threads, gate=gate)
        self._randomise_visuals = randomise_visuals
