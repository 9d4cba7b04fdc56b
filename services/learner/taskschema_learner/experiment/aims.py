"""What an experiment was to reach, beside what it reached."""

from collections.abc import Iterable, Sequence
from statistics import median

from taskschema_learner.experiment.cell import CellPolicy, CellResult
from taskschema_learner.experiment.plan import BASELINE_FACTOR, COMPARED_TASK, RELEARNING_BUDGETS

Aim = tuple[str, str, bool | str]
"""What was aimed at, the figure, and whether it was reached, or in words why that cannot be said."""


def aims_table(cells: Sequence[CellResult]) -> list[str]:
    """Return the table in Markdown of what can be judged from these cells; nothing if that is nothing.

    The aims are the paper's findings (Figures 5 and 6), with a factor of our own.
    """
    rows = [*_learned(cells), *_against_baseline(cells), *_against_oracle(cells), *_transferred(cells)]
    if not rows:
        return []
    lines = [f"| {aim} | {figure} | {_word(reached)} |" for aim, figure, reached in rows]
    return ["## What was aimed at", "", "| aim | figure | reached |", "|---|---|---|", *lines, ""]


def _word(reached: bool | str) -> str:
    if isinstance(reached, str):
        return reached
    return "yes" if reached else "**no**"


def _over(cells: Iterable[CellResult], policy: CellPolicy) -> dict[str, list[CellResult]]:
    """Return the finished cells of a policy, by task."""
    groups: dict[str, list[CellResult]] = {}
    for result in cells:
        if result.policy == policy and result.is_over:
            groups.setdefault(result.task, []).append(result)
    return groups


def _solved(results: Iterable[CellResult]) -> list[CellResult]:
    return [result for result in results if result.state == "solved"]


def _learned(cells: Sequence[CellResult]) -> Iterable[Aim]:
    for task, over in _over(cells, "schema").items():
        solved = _solved(over)
        figure = f"{len(solved)} of {len(over)}"
        yield f"{task}: `schema` solves it with every seed", figure, len(solved) == len(over)
        if solved:
            alike = sum(result.verdict in ("equal", "equivalent") for result in solved)
            figure = f"{alike} of {len(solved)}"
            yield f"{task}: its schemas are equal or equivalent to the paper's", figure, alike == len(solved)


def _against_baseline(cells: Sequence[CellResult]) -> Iterable[Aim]:
    learned, baseline = _over(cells, "schema"), _over(cells, "state")
    for task in learned:
        if task not in baseline:
            continue
        if task == COMPARED_TASK:
            ratio = _middle(baseline[task]) / _middle(learned[task])
            aim = f"{task}: `state` takes at least {BASELINE_FACTOR} times as many episodes"
            yield aim, f"{ratio:.2g} times", ratio >= BASELINE_FACTOR
        else:
            solved, over = len(_solved(baseline[task])), len(baseline[task])
            aim = f"{task}: `state` does not solve it with the episodes of the slowest `schema` seed"
            yield aim, f"{solved} of {over} seeds do", solved == 0


def _against_oracle(cells: Sequence[CellResult]) -> Iterable[Aim]:
    learned, given = _over(cells, "schema"), _over(cells, "oracle")
    for task in learned:
        if task not in given:
            continue
        ratio = _middle(given[task]) / _middle(learned[task])
        yield f"{task}: `oracle` takes fewer episodes than `schema`", f"{ratio:.2g} times", ratio < 1


def _transferred(cells: Sequence[CellResult]) -> Iterable[Aim]:
    for task, over in _over(cells, "transferred").items():
        solved = len(_solved(over))
        aim = f"{task}: 90 % within the budget, the schema transferred"
        yield aim, f"{solved} of {len(over)} seeds", solved == len(over)
    for task, over in _over(cells, "re-learned").items():
        aim = f"{task}: not by then, the schema learned again"
        yield aim, f"{len(_solved(over))} of {len(over)} seeds do", _is_crucial(task, over)


def _is_crucial(task: str, relearned: Sequence[CellResult]) -> bool | str:
    """Whether no schema was learned again by the time in which that should be possible."""
    if _solved(relearned):
        return False
    derived = RELEARNING_BUDGETS.get(task)
    if derived is None:
        return "not judged: what learning it should take is not known"
    if min(result.budget for result in relearned) < derived:
        return "not judged: its budget was below the derived one"
    return True


def _middle(results: Iterable[CellResult]) -> float:
    """Return the median of the episodes; what was not solved counts with all that it had."""
    return median(result.episodes for result in results)
