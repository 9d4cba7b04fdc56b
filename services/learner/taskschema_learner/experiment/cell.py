"""A cell of an experiment's matrix, and what came out of it."""

from dataclasses import dataclass
from typing import Literal

import msgspec

from taskschema.tasks.task import Schema
from taskschema_learner.evaluation import SuccessRate
from taskschema_learner.schemas.schema_report import SchemaVerdict

CellPolicy = Literal["schema", "state", "oracle", "transferred", "re-learned"]
"""What is compared: policies on states, and on images where their schema comes from."""
IMAGE_POLICIES = ("transferred", "re-learned")
CellState = Literal["solved", "not solved", "interrupted"]
"""Reached 90 %; spent its budget without that; neither yet: the next start goes on with it."""


@dataclass(frozen=True)
class Cell:
    """One training of the matrix."""

    task: str
    policy: CellPolicy
    seed: int

    @property
    def name(self) -> str:
        """Name of its run and of its files."""
        return f"{self.task}-{self.policy}-seed{self.seed}"


class Verification(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What came of a cell that was trained again."""

    day: str
    """In UTC."""
    commit: str
    """Of the source tree that trained it again."""
    same: bool
    """Whether the policy at the end has the same hash."""


class CellResult(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Facts about one cell, as far as it has come."""

    task: str
    policy: CellPolicy
    seed: int
    state: CellState
    episodes: int
    """Episodes so far; of a solved cell: the episodes to 90 %."""
    rounds: int
    budget: int
    """Episodes after which the cell gives up."""
    minutes: float
    """Wall time of its rounds [min]."""
    success_last_100: float
    """Share of successes among its last 100 episodes."""
    schema: Schema | None = None
    """The most probable pair of every used step; None: the `state` policy has no schema."""
    verdict: SchemaVerdict | None = None
    """The schema beside the paper's."""
    config_hash: str
    """Of the run's config."""
    sha256: str
    """Of the policy at the end: `taskschema hash RUN`."""
    commit: str
    """Commit of the source tree, if it was trained from one."""
    steps: int | None = None
    """Skill pairs executed in these episodes; None: written before they were counted."""
    held_out: SuccessRate | None = None
    """On instances that it was not trained on, with mean actions; None: not solved, or not measured."""
    verification: Verification | None = None
    """None: not trained again since."""

    @property
    def cell(self) -> Cell:
        """The cell that this is about."""
        return Cell(self.task, self.policy, self.seed)

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to do, unless the budget grows."""
        return self.state != "interrupted"
