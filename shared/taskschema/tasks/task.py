"""The interface of a task, and of the environment that runs many of its episodes at once."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np

from taskschema.arrays import AnyArray, BoolArray, FloatArray, IntArray
from taskschema.config import ObservationKind
from taskschema.frames import Frames
from taskschema.observation import ObservationLayout
from taskschema.skills.pairs import PairSpace
from taskschema.skills.table_space import TableRectangle

Schema = tuple[tuple[str, str], ...]
"""One (left skill, right skill) per step, at most T of them."""
GOOD_SHARE = 0.95
"""Of a task's instances: what a schema of its good set solves at least, with some arguments."""


@dataclass(frozen=True)
class StepResult:
    """What one step (one skill pair, both arms at once) led to, for the M episodes stepped."""

    observations: AnyArray
    """[M, D] in SI units, as `Task.observation` lays out; or frames [M, 256, 256, 3], arbitrary where the
    episode is over."""
    success: BoolArray
    """[M] whether the goal was reached during or at the end of the step."""
    diverged: BoolArray
    """[M] whether the simulation broke down: the episode is failed and counted."""
    physics_steps: IntArray
    """[M] physics steps computed for each episode, a function of the episode alone; 0 without physics."""
    refused: BoolArray | None = None
    """[M] whether a safety gate refused the step: nothing moved; None: there is no gate."""


class BatchEnvironment(Protocol):
    """N episodes of one task, stepped together; each one's result does not depend on the others."""

    def reset(self, generators: Sequence[np.random.Generator]) -> AnyArray:
        """Start one episode per generator and return observations [N, ...]; drops the episodes before."""
        ...

    def step(self, episodes: IntArray, pairs: IntArray, arguments: FloatArray) -> StepResult:
        """Run one step of the episodes named by index [M], with pairs [M] and SI arguments [M, A]."""
        ...

    def close(self) -> None:
        """Free threads and memory."""
        ...


class SeenEnvironment(BatchEnvironment, Protocol):
    """An environment that an overhead camera looks at."""

    def frames(self, episodes: IntArray) -> Frames:
        """Return what the camera sees of M episodes: [M, 256, 256, 3]."""
        ...

    def pose_anchors(self, episodes: IntArray) -> FloatArray:
        """Return [M, 3] what turns a location on the table into what skills are planned from.

        The object's centre along x and y in the world frame, which offsets are from, and how far above that
        centre a go-to pose without a height of its own goes [m].
        """
        ...


class Task(ABC):
    """One task family with one object and its randomisation.

    A subclass names its skills and observation and, if it needs no physics, implements
    `make_environment`. Tasks with a MuJoCo scene derive from `SceneTask`; workers know how to run those.
    """

    name: ClassVar[str]
    """Name on the command line, for example `lateral-lifting`."""
    family: ClassVar[str]
    """Task family (paper, Table I)."""
    summary: ClassVar[str]
    """One sentence: object, randomisation, goal."""
    horizon: ClassVar[int] = 3
    """T, the most steps of an episode (paper: 3)."""
    paper_schema: ClassVar[Schema]
    """The schema that the paper found (Table I), or the known optimum of a task of one's own."""

    location_range: ClassVar[tuple[float, float]] = (0.0, 0.0)
    """The object's centre is drawn within +- these distances from the table's centre along x and y [m]."""
    table_view: ClassVar[float] = 0.8
    """Edge length of the square of table top, about its centre, that the overhead camera sees [m]."""

    @property
    @abstractmethod
    def pairs(self) -> PairSpace:
        """The skill pairs and their arguments."""

    @property
    @abstractmethod
    def observation(self) -> ObservationLayout:
        """The fields of the state observation."""

    @cached_property
    def table(self) -> TableRectangle:
        """Where on the table skills may be told to act if the object's pose is not known."""
        return TableRectangle.around(self.location_range)

    @cached_property
    def image_pairs(self) -> PairSpace:
        """The same skill pairs with the search spaces of images: locations on the table."""
        return PairSpace(self.pairs.skills, self.table)

    def seen_pairs(self, observation: ObservationKind) -> PairSpace:
        """Return the pairs with the search spaces that policies on this kind of observation act in."""
        return self.image_pairs if observation == "image" else self.pairs

    @cached_property
    def paper_pairs(self) -> IntArray:
        """[at most T] the paper's schema as pair indices."""
        return np.array([self.pairs.index(left, right) for left, right in self.paper_schema], dtype=np.int64)

    def expert_arguments(self, observations: AnyArray, step: int) -> FloatArray:
        """Return SI arguments [N, A] that solve the task under the paper's schema at step 0..T-1.

        A scripted expert may look only at the observation [N, D].

        Raises:
            NotImplementedError: if the task has no scripted expert.
        """
        raise NotImplementedError(f"Task {self.name!r} has no scripted expert.")

    def make_environment(self, threads: int = 1) -> BatchEnvironment:
        """Return an environment that needs no simulator.

        Raises:
            NotImplementedError: if the task runs in a simulator; workers then build it from its scene.
        """
        raise NotImplementedError(f"Task {self.name!r} runs in a simulator.")
