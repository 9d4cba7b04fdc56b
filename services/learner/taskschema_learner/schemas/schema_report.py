"""How a run's schema relates to the paper's: equal, equivalent or different (docs/read-a-schema.md)."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

import msgspec

from taskschema.errors import SchemaMismatchError
from taskschema.schema import BestPair
from taskschema.skills.no_op import NoOp
from taskschema.tasks.registry import task_names
from taskschema.tasks.task import Schema, Task


class SchemaVerdict(StrEnum):
    """What a learned schema is, measured against the paper's and the audit's good set."""

    EQUAL = "equal"
    """The paper's schema (Table I)."""
    EQUIVALENT = "equivalent"
    """Another member of the good set, or what begins with one."""
    DIFFERENT = "different"
    """Neither."""


@dataclass(frozen=True)
class SchemaComparison:
    """A learned schema beside the paper's."""

    found: Schema
    """The most probable pair of every used step."""
    paper: Schema
    verdict: SchemaVerdict

    @property
    def is_success(self) -> bool:
        """Whether the schema counts as found: equal or equivalent."""
        return self.verdict is not SchemaVerdict.DIFFERENT

    @property
    def sentence(self) -> str:
        """The comparison in one sentence."""
        if self.verdict is SchemaVerdict.EQUAL:
            return f"equal to the paper's: {schema_words(self.paper)}"
        if self.verdict is SchemaVerdict.EQUIVALENT:
            return f"equivalent to the paper's ({schema_words(self.paper)}): another schema of the good set"
        return f"different from the paper's, which is {schema_words(self.paper)}"


def schema_words(schema: Schema) -> str:
    """Return a schema on one line, left arm first, for example `(reach, reach), (raise, raise)`."""
    return ", ".join(f"({left}, {right})" for left, right in schema)


def has_good_set(task: Task) -> bool:
    """Whether the package has an audit of the task; if not, `good_schemas` knows the paper's alone."""
    return _good_set_file(task).is_file()


def _good_set_file(task: Task) -> Traversable:
    return resources.files("taskschema") / "data" / "good_schemas" / f"{task.name}.json"


def audit_command(task: Task) -> str:
    """Return the command that writes a task's good set, FILE and all, as a person would type it."""
    reference = task.name if task.name in task_names() else "--task-file FILE:CLASS"
    return f"taskschema audit {reference} --good-schemas FILE"


def good_schemas(task: Task, file: Path | None = None) -> list[Schema]:
    """Return the schemas that solve the task: the paper's first, then those that an audit found good.

    Args:
        task: whose schemas they are.
        file: what the audit wrote with `--good-schemas`; None: the package's, if there is one.

    Raises:
        SchemaMismatchError: if the file cannot be read, is damaged, or another task's.

    """
    paper = tuple(task.paper_schema)
    if file is None and not has_good_set(task):
        return [paper]
    source = _good_set_file(task) if file is None else file
    try:
        audited = msgspec.json.decode(source.read_bytes(), type=list[tuple[tuple[str, str], ...]])
    except (OSError, msgspec.MsgspecError) as error:
        raise SchemaMismatchError(
            f"{source} cannot be read ({error}): make it again with `{audit_command(task)}`."
        ) from None
    if any(pair not in task.pairs.pairs for schema in audited for pair in schema):
        raise SchemaMismatchError(
            f"{source} has skills that {task.name} does not have: it is another task's, whose own "
            f"`{audit_command(task)}` writes."
        )
    return [paper, *(schema for schema in audited if schema != paper)]


def compare(task: Task, best: Sequence[BestPair], good_set: Path | None = None) -> SchemaComparison:
    """Compare a run's most probable pairs, one per step, with the paper's schema and the good set.

    Steps after the one at which episodes succeed are unused and match anything. A run that never succeeded
    uses all of its steps.

    Args:
        task: of the run.
        best: the most probable pair of every step.
        good_set: file of the good schemas; None: the package's.

    Raises:
        SchemaMismatchError: if the file of good schemas cannot be read, is damaged, or another task's.

    """
    used = tuple((item.left, item.right) for item in best if item.used)
    return compare_used(task, used or tuple((item.left, item.right) for item in best), good_set)


def compare_used(task: Task, used: Schema, good_set: Path | None = None) -> SchemaComparison:
    """Compare the used steps of a schema with the paper's and the good set.

    An episode ends at its first success, so whatever follows steps that solve a task takes nothing away. The
    audit measures schemas of T steps; one that ends in no-ops tells what the steps before them do alone. A
    schema that begins with these is as good.

    Raises:
        SchemaMismatchError: if the file of good schemas cannot be read, is damaged, or another task's.

    """
    paper, *others = good_schemas(task, good_set)
    if used == paper:
        verdict = SchemaVerdict.EQUAL
    elif any(used[: len(core)] == core for core in (paper, *map(_without_rest, others))):
        verdict = SchemaVerdict.EQUIVALENT
    else:
        verdict = SchemaVerdict.DIFFERENT
    return SchemaComparison(used, paper, verdict)


def _without_rest(schema: Schema) -> Schema:
    """Return a schema without the steps at its end in which both arms do nothing."""
    while schema and all(name == NoOp.name for name in schema[-1]):
        schema = schema[:-1]
    return schema
