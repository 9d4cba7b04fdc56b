"""A bar to lift in a plane world without physics, with a known optimum.

It takes seconds where lateral lifting takes minutes, and it is the example for tasks of one's own: this
file works as it is as `--task-file toy.py:Toy`.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray, IntArray
from taskschema.frames import FRAME_SHAPE, FRAME_SIZE, Frames
from taskschema.observation import ObservationField, ObservationLayout
from taskschema.skills.argument import Argument
from taskschema.skills.pairs import PairSpace
from taskschema.skills.skill import Skill
from taskschema.tasks.task import StepResult, Task

TOLERANCE = 0.04
"""Largest distance of a reach from its handle that still holds it [m]."""
VIEW = 0.26
"""Edge length of the square that frames show [m]."""
WOOD = (219, 199, 168)
"""Colour of the table."""
HANDLE_COLOURS = ((170, 30, 30), (30, 30, 170))
"""Of the left and the right handle."""
HANDLE_WIDTH = 0.024
"""[m]"""
GOAL_HEIGHT = 0.25
"""Height to which both ends must be raised [m]."""


class Reach(Skill):
    """Put the hand somewhere and close it."""

    name = "reach"
    summary = "Move the hand to a place and close it there."
    families = ("toy",)
    arguments = (
        Argument("x", "m", -0.1, 0.1, "Offset of the hand from the object's centre, to the right."),
        Argument("y", "m", -0.1, 0.1, "Offset of the hand from the object's centre, away from the left arm."),
    )
    start_state = "anywhere"
    end_state = "at the place; holds its handle if that is within 4 cm"


class Raise(Skill):
    """Raise the hand."""

    name = "raise"
    summary = "Raise the hand, with what it holds."
    families = ("toy",)
    arguments = (Argument("distance", "m", 0.0, 0.5, "How far to raise."),)
    start_state = "anywhere"
    end_state = "raised; a bar that only one hand raises slips from both"


class Wait(Skill):
    """Do nothing."""

    name = "no_op"
    summary = "Stay as it is."
    families = ("all",)
    start_state = "anywhere"
    end_state = "unchanged"


class ToyEnvironment:
    """N toy episodes; every quantity is exact, so that results can be computed by hand."""

    def __init__(self, task: "Toy") -> None:
        self._task = task

    def reset(self, generators: Sequence[np.random.Generator]) -> FloatArray:
        """Draw the two handles of each episode uniformly within +-6 cm of their usual places."""
        usual = np.array([[0.0, -0.05], [0.0, 0.05]])
        draws = np.stack([rng.uniform(-0.06, 0.06, size=(2, 2)) for rng in generators])
        self._handles: FloatArray = np.clip(usual + draws, -0.1, 0.1)
        self._holding: BoolArray = np.zeros((len(generators), 2), dtype=bool)
        self._time: IntArray = np.zeros(len(generators), dtype=np.int64)
        return self._observe(np.arange(len(generators)))

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        """Reach, raise or wait with both hands at once; the outcome follows from the distances alone."""
        space = self._task.pairs
        raised = np.zeros((len(episodes), 2))
        for arm in range(2):
            skill = space.skill_index(pairs, arm)
            target = arguments[:, space.columns(arm, 0)]
            distance = np.linalg.norm(target - self._handles[episodes, arm], axis=1)
            self._holding[episodes, arm] = np.where(
                skill == 0, distance <= TOLERANCE, self._holding[episodes, arm]
            )
            raised[:, arm] = np.where(skill == 1, arguments[:, space.columns(arm, 1)][:, 0], 0.0)
        holding = self._holding[episodes].all(axis=1)
        success: BoolArray = np.logical_and(holding, np.all(raised >= GOAL_HEIGHT, axis=1))
        slips = (raised > 0).any(axis=1) & ~success
        self._holding[episodes[slips]] = False
        self._time[episodes] += 1
        no_physics = np.zeros(len(episodes), dtype=np.int64)
        return StepResult(self._observe(episodes), success, no_physics.astype(bool), no_physics)

    def frames(self, episodes: IntArray) -> Frames:
        """Draw each episode's handles on a wooden table: left red, right blue, half as wide when held."""
        return np.stack([_drawn(self._handles[index], self._holding[index]) for index in episodes])

    def pose_anchors(self, episodes: IntArray) -> FloatArray:
        """Return zeros [M, 3]: the bar's centre is the table's."""
        return np.zeros((len(episodes), 3))

    def close(self) -> None:
        """Nothing to free."""

    def _observe(self, episodes: IntArray) -> FloatArray:
        horizon = self._task.horizon
        timestep = np.eye(horizon + 1)[self._time[episodes]][:, :horizon]
        handles = self._handles[episodes].reshape(len(episodes), 4)
        return np.concatenate([handles, self._holding[episodes].astype(float), timestep], axis=1)


def _drawn(handles: FloatArray, holding: BoolArray) -> Frames:
    """Return the frame [256, 256, 3] of two handles [2, 2] in metres, each held or not [2]."""
    frame = np.full(FRAME_SHAPE, WOOD, dtype=np.uint8)
    places = (np.arange(FRAME_SIZE) + 0.5) / FRAME_SIZE * VIEW - 0.5 * VIEW
    for handle, held, colour in zip(handles, holding, HANDLE_COLOURS, strict=True):
        width = 0.5 * HANDLE_WIDTH * (0.5 if held else 1.0)
        rows, columns = np.abs(-places - handle[1]) <= width, np.abs(places - handle[0]) <= width
        frame[np.ix_(rows, columns)] = colour
    return frame


class Toy(Task):
    """Two hands reach for the handles of a bar and raise it together."""

    name = "toy"
    family = "toy"
    summary = "Reach for both handles of a bar, then raise it by 25 cm with both hands; no physics."
    table_view = VIEW
    paper_schema = (("reach", "reach"), ("raise", "raise"))

    @cached_property
    def pairs(self) -> PairSpace:
        """Nine pairs: reach, raise and no-op for each hand."""
        return PairSpace((Reach(), Raise(), Wait()))

    @cached_property
    def observation(self) -> ObservationLayout:
        """Places of the handles, what is held, and the timestep."""
        return ObservationLayout(
            (
                ObservationField("handles", 4, "m", "x, y of the left and the right handle.", scale=0.1),
                ObservationField("holding", 2, "1", "1 for a hand that holds its handle."),
                ObservationField("timestep", 3, "1", "One-hot number of the step, from 0."),
            )
        )

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        """Reach for the handles, then raise by 40 cm."""
        handles = self.observation.get(observations, "handles")
        arguments = np.full((len(observations), self.pairs.argument_count), 0.4)
        for arm in range(2):
            arguments[:, self.pairs.columns(arm, 0)] = handles[:, 2 * arm : 2 * arm + 2]
        return arguments

    def make_environment(self, threads: int = 1) -> ToyEnvironment:
        """Return the environment; `threads` makes no difference."""
        return ToyEnvironment(self)
