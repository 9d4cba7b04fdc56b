"""An experiment's summary as a page: episodes to 90 %, and what every cell found."""

from collections.abc import Sequence
from statistics import median

from taskschema.tasks.registry import get_task
from taskschema.tasks.task import GOOD_SHARE
from taskschema_learner.experiment.aims import aims_table
from taskschema_learner.experiment.cell import Cell, CellResult
from taskschema_learner.experiment.plan import PAPER_TASKS, WHOLE, is_done
from taskschema_learner.experiment.results_folder import Summary
from taskschema_learner.schemas.schema_report import SchemaVerdict, has_good_set, schema_words

POLICIES = ("schema", "state", "oracle", "transferred", "re-learned")
DEFAULTS = ("Every cell is `taskschema train TASK --policy POLICY --seed SEED` with the defaults.",)
LEARNING = ("schema", "re-learned")
"""Policies that learn their schema."""
REFERENCES = ("schema", "transferred", "re-learned")
"""Policies whose episodes the others' are compared with: the first that an experiment has."""
SETTINGS = {
    "images-sim": (
        "Every cell is `taskschema train TASK --observation image --seed SEED`; `transferred` adds",
        "`--init-schema TASK.json --freeze-schema`, a schema learned from states.",
    ),
}
"""What the cells are, of experiments other than with the defaults."""


def report(summary: Summary, remarks: str = "") -> str:
    """Return the page in Markdown.

    Args:
        summary: of the experiment.
        remarks: what its figures do not say by themselves, in Markdown.

    Raises:
        TaskschemaError: if a cell's task is not there any more.

    """
    versions = ", ".join(f"{name} {version}" for name, version in summary.versions.items())
    lines = [
        f"# {summary.experiment}: success rate against episodes",
        "",
        *(f"    {command}" for command in summary.commands),
        "",
        f"On {'; '.join(summary.machines)}. Versions: {versions}.",
        *SETTINGS.get(summary.experiment, DEFAULTS),
        "It ends when 90 % of the last 100 episodes succeed or its budget is spent. `summary.json` holds all",
        "of this for a program, `cells/` the curves; `taskschema plot` draws them. Skills are skill pairs,",
        "both arms at once.",
        "",
        "![learning curves](figure.png)",
        "",
        *_episodes_table(summary.cells),
        *_open_cells(summary),
        *aims_table(summary.cells),
        *([remarks.rstrip(), ""] if remarks else []),
        *_schema_table(summary.cells),
        *_cell_table(summary.cells),
    ]
    return "\n".join(lines)


def _tasks(cells: Sequence[CellResult]) -> list[str]:
    return list(dict.fromkeys(result.task for result in cells))


def _first(policies: Sequence[str], cells: Sequence[CellResult]) -> str | None:
    """Return the first of some policies that has cells."""
    found = {result.policy for result in cells}
    return next((policy for policy in policies if policy in found), None)


def _group(cells: Sequence[CellResult], task: str, policy: str) -> dict[int, CellResult]:
    return {result.seed: result for result in cells if (result.task, result.policy) == (task, policy)}


def _episodes_table(cells: Sequence[CellResult]) -> list[str]:
    seeds = sorted({result.seed for result in cells})
    compared = _first(REFERENCES, cells)
    heads = ["task", "policy", *(f"seed {seed}" for seed in seeds), "median"]
    heads.append("times -" if compared is None else f"times `{compared}`")
    lines = ["## Episodes to 90 %", "", f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for task in _tasks(cells):
        reference = None if compared is None else _median(_group(cells, task, compared))
        for policy in POLICIES:
            group = _group(cells, task, policy)
            if group:
                own = _median(group)
                words = [_episodes(group.get(seed)) for seed in seeds]
                words += ["-" if own is None else _bounded(*own), _ratio(own, reference)]
                lines.append(f"| {task} | {policy} | {' | '.join(words)} |")
    note = "`> N`: not within its budget of N episodes; `N so far`: interrupted there; -: not trained yet."
    return [*lines, "", note, ""]


def _episodes(result: CellResult | None) -> str:
    if result is None:
        return "-"
    if result.state == "interrupted":
        return f"{result.episodes:,} so far"
    return _bounded(result.episodes, result.state == "solved")


def _median(group: dict[int, CellResult]) -> tuple[float, bool] | None:
    """Return the median of a group's finished cells, and whether it is one: else the true one is larger.

    A cell that was not solved counts as larger than every one that was.
    """
    over = sorted((item.state != "solved", item.episodes) for item in group.values() if item.is_over)
    if not over:
        return None
    middle = over[(len(over) - 1) // 2 : len(over) // 2 + 1]
    return median(episodes for _, episodes in middle), not any(unsolved for unsolved, _ in middle)


def _bounded(episodes: float, exact: bool) -> str:
    return f"{episodes:,.0f}" if exact else f"> {episodes:,.0f}"


def _ratio(own: tuple[float, bool] | None, reference: tuple[float, bool] | None) -> str:
    if own is None or reference is None or not reference[1]:
        return "-"
    return f"{'' if own[1] else 'more than '}{own[0] / reference[0]:.2g}"


def _open_cells(summary: Summary) -> list[str]:
    """Return which cells the experiment's command would still train, and how far they are."""
    if not any(result.task in PAPER_TASKS for result in summary.cells):
        return []
    known = {result.cell: result for result in summary.cells}
    open_seeds: dict[tuple[str, str], list[str]] = {}
    plan = WHOLE[summary.experiment]
    for cell in sorted(plan.cells(), key=_place):
        result = known.get(cell)
        if not is_done(result, plan.budget_of(cell, known)):
            so_far = "" if result is None else f" (at {result.episodes:,} episodes)"
            open_seeds.setdefault((cell.task, cell.policy), []).append(f"{cell.seed}{so_far}")
    if not open_seeds:
        return ["Every cell of the experiment was trained to its end.", ""]
    lines = [
        f"- {task}, `{policy}`: seeds {', '.join(seeds)}" for (task, policy), seeds in open_seeds.items()
    ]
    return ["Not trained to their end, for want of time; the command goes on with them:", "", *lines, ""]


def _place(cell: Cell) -> tuple[int, int, int]:
    return PAPER_TASKS.index(cell.task), POLICIES.index(cell.policy), cell.seed


def _schema_table(cells: Sequence[CellResult]) -> list[str]:
    heads = ["task", "the paper's schema", "solved", *SchemaVerdict, "of these as good"]
    learned = _first(LEARNING, cells)
    if learned is None:
        return []
    lines = [f"## The schema that `{learned}` found", ""]
    lines += [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for task_name in _tasks(cells):
        task = get_task(task_name)
        over = [result for result in _group(cells, task_name, learned).values() if result.is_over]
        solved = [result for result in over if result.state == "solved"]
        counts = [sum(result.verdict == verdict for result in solved) for verdict in SchemaVerdict]
        as_good = sum(_is_good_beyond_the_audit(result) for result in solved)
        numbers = [f"{len(solved)} of {len(over)}", *map(str, counts), str(as_good)]
        name = task_name if has_good_set(task) else f"{task_name} (1)"
        lines.append(f"| {name} | {schema_words(task.paper_schema)} | {' | '.join(numbers)} |")
    note = (
        "Verdicts of solved cells. Equivalent: it is, or begins with, another member of the audit's good "
        f"set.\nAs good: different, but its policy solves at least {GOOD_SHARE:.0%} of the held-out "
        "instances, which is what the\naudit asks of a good schema; the audit's own search for arguments "
        "did not get there."
    )
    if not all(has_good_set(get_task(name)) for name in _tasks(cells)):
        note += " (1): no audit yet, so that whatever is not equal counts as different."
    return [*lines, "", note, ""]


def _is_good_beyond_the_audit(result: CellResult) -> bool:
    rate = result.held_out
    return result.verdict == "different" and rate is not None and rate.rate >= GOOD_SHARE


def _cell_table(cells: Sequence[CellResult]) -> list[str]:
    heads = ["task", "policy", "seed", "state", "episodes", "skills", "budget", "minutes", "last 100"]
    heads += ["held out", "schema", "is", "commit"]
    lines = ["## Cells", "", f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for result in cells:
        schema = "-" if result.schema is None else schema_words(result.schema)
        given = result.policy in ("oracle", "transferred")
        verdict = "given" if given else result.verdict or "-"
        skills = "-" if result.steps is None else f"{result.steps:,}"
        lines.append(
            f"| {result.task} | {result.policy} | {result.seed} | {result.state} | {result.episodes:,} "
            f"| {skills} | {result.budget:,} | {result.minutes:.1f} | {result.success_last_100:.0%} "
            f"| {_held_out(result)} | {schema} | {verdict} | {result.commit or '-'} |"
        )
    note = (
        "Held out: share of 200 instances not trained on that mean actions solve, with its 95 % interval.\n"
        "Commit: of the code that trained it; `+`: with changes that were not committed."
    )
    return [*lines, "", note, *_verified(cells), ""]


def _verified(cells: Sequence[CellResult]) -> list[str]:
    """Return which cells were trained again, with which code, and whether that gave the same policy."""
    names: dict[str, list[str]] = {}
    for result in cells:
        if (again := result.verification) is not None:
            outcome = "the same policy, to the bit" if again.same else "**another policy**"
            when = f"Trained again on {again.day} with commit {again.commit or 'unknown'}, {outcome}"
            names.setdefault(when, []).append(f"{result.task} {result.policy} {result.seed}")
    return [line for when, cells_ in names.items() for line in ("", f"{when}: {', '.join(cells_)}.")]


def _held_out(result: CellResult) -> str:
    rate = result.held_out
    return "-" if rate is None else f"{rate.rate:.0%} [{rate.low:.0%}, {rate.high:.0%}]"
