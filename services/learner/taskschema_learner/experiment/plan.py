"""What an experiment trains next, and for how long: the cheapest and most telling cells come first."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

from taskschema_learner.experiment.cell import Cell, CellPolicy, CellResult

PAPER_TASKS = ("lateral-lifting", "picking", "opening", "rotating")
"""The paper's four families, in the order of its Table I."""
FIRST_SEEDS = 3
"""Seeds of every task and policy that come before anybody's others."""
BASELINE_FACTOR = 5
"""The `state` baseline may take so many times the median of `schema` where that is compared."""
COMPARED_TASK = "lateral-lifting"
"""Task on which the baseline's budget is that multiple; elsewhere it is the slowest `schema` seed's."""
RELEARNING_BUDGETS = {"lateral-lifting": 80_500, "picking": 22_800, "opening": 197_200}
"""Episodes in which a schema should be learned again from images, by task: results/images-sim/budget.md.

Rotating's are not known: no random success was seen there.
"""


@dataclass(frozen=True)
class Plan:
    """The matrix of an experiment and the episodes that each of its cells may take."""

    tasks: Sequence[str] = PAPER_TASKS
    policies: Sequence[CellPolicy] = ("schema", "state", "oracle")
    seeds: int = 5
    """Seeds 0 to N - 1 of every task and policy."""
    budget: int = 200_000
    """Episodes of a cell other than `state` (audits ask for a first success within 200,000)."""
    relearning_budgets: Mapping[str, int] = field(default_factory=dict)
    """Episodes of a cell of `re-learned`, by task; `budget` for a task that is not there."""
    baseline_budget: int = 0
    """Least episodes of a cell of `state`, whose budget otherwise follows from those of `schema`."""

    def cells(self) -> list[Cell]:
        """Return the matrix in the order of training.

        Three seeds of `oracle` and `schema` on every task come first, one seed of all tasks after the other;
        then the baseline, whose budget follows from them; then the other seeds in the same order.
        """
        blocks = [range(min(FIRST_SEEDS, self.seeds)), range(FIRST_SEEDS, self.seeds)]
        first: tuple[CellPolicy, ...] = ("oracle", "schema", "transferred", "re-learned")
        groups: tuple[tuple[CellPolicy, ...], ...] = (first, ("state",))
        return [
            Cell(task, policy, seed)
            for seeds in blocks
            for group in groups
            for seed in seeds
            for task in self.tasks
            for policy in group
            if policy in self.policies
        ]

    def budget_of(self, cell: Cell, results: Mapping[Cell, CellResult]) -> int:
        """Return the episodes that a cell may take, given the results so far.

        A `schema` seed that was not solved counts with the episodes that it took.
        """
        if cell.policy == "re-learned":
            return self.relearning_budgets.get(cell.task, self.budget)
        if cell.policy != "state":
            return self.budget
        taken = [
            result.episodes
            for result in results.values()
            if result.task == cell.task and result.policy == "schema" and result.is_over
        ]
        if not taken:
            return max(self.budget, self.baseline_budget)
        own = BASELINE_FACTOR * median(taken) if cell.task == COMPARED_TASK else max(taken)
        return max(math.ceil(own), self.baseline_budget)


WHOLE = {
    "paper-sim": Plan(),
    "images-sim": Plan(
        policies=("transferred", "re-learned"), budget=40_000, relearning_budgets=RELEARNING_BUDGETS
    ),
}
"""All cells that an experiment has, which its command trains unless it is told a part of them.

Why 40,000: docs/train-from-images.md.
"""


def is_done(result: CellResult | None, budget: int) -> bool:
    """Whether a cell needs no more training: it is solved, or has spent this budget."""
    return result is not None and (result.state == "solved" or result.episodes >= budget)


def next_cell(
    plan: Plan, results: Mapping[Cell, CellResult], failed: Collection[Cell]
) -> tuple[Cell, int] | None:
    """Return the first cell that is not done, with its budget; None if all that did not fail are."""
    for cell in plan.cells():
        budget = plan.budget_of(cell, results)
        if cell not in failed and not is_done(results.get(cell), budget):
            return cell, budget
    return None
