"""How a learned schema differs from the paper's, step by step and in words."""

from pathlib import Path

from taskschema.tasks.task import Schema, Task
from taskschema_learner.schemas.schema_report import (
    SchemaComparison,
    SchemaVerdict,
    audit_command,
    good_schemas,
    has_good_set,
    schema_words,
)

ARM_WORDS = ("left", "right")


def explain(task: Task, comparison: SchemaComparison, good_set: Path | None = None) -> list[str]:
    """Return sentences for a person: what each step shares with the paper's, and why the verdict is so.

    Args:
        task: of the run.
        comparison: with the paper's schema and the good set.
        good_set: file that the good set came from; None: the package's.

    """
    found, paper = comparison.found, comparison.paper
    lines = [
        _step(number, found[number - 1], paper[number - 1] if number <= len(paper) else None)
        for number in range(1, len(found) + 1)
    ]
    lines += [
        f"Step {number}: not there; the paper's schema goes on with {schema_words((pair,))}."
        for number, pair in enumerate(paper[len(found) :], start=len(found) + 1)
    ]
    if comparison.verdict is not SchemaVerdict.EQUAL and _exchanged(found) == paper:
        lines.append("It is the paper's schema with the arms exchanged.")
    return [*lines, _reason(task, comparison, good_set)]


def _step(number: int, found: tuple[str, str], paper: tuple[str, str] | None) -> str:
    if paper is None:
        return f"Step {number}: {schema_words((found,))}, one step more than the paper's schema has."
    if found == paper:
        return f"Step {number}: {schema_words((found,))}, as in the paper."
    differences = [
        f"the {arm} arm runs {own} instead of {other}"
        for arm, own, other in zip(ARM_WORDS, found, paper, strict=True)
        if own != other
    ]
    return f"Step {number}: {' and '.join(differences)}."


def _exchanged(schema: Schema) -> Schema:
    return tuple((right, left) for left, right in schema)


def _reason(task: Task, comparison: SchemaComparison, good_set: Path | None) -> str:
    """Say what the verdict rests on."""
    if comparison.verdict is SchemaVerdict.EQUAL:
        return "Equal: every step that is used is the paper's."
    if good_set is None and not has_good_set(task):
        return (
            f"No audit of {task.name} is there, so that whatever is not the paper's counts as different: "
            f"`{audit_command(task)}` writes which schemas solve the task as well, and --good-schemas FILE "
            "here reads it."
        )
    schemas = len(task.pairs) ** task.horizon
    good = sum(len(schema) == task.horizon for schema in good_schemas(task, good_set))
    audited = f"solve at least 95 % of the audit's instances, of which there are {good} among {schemas:,}"
    if comparison.verdict is SchemaVerdict.EQUIVALENT:
        return f"Equivalent: it is, or begins with, another of the schemas that {audited}."
    return f"Different: it is none of the schemas that {audited}, although it may succeed in some."
