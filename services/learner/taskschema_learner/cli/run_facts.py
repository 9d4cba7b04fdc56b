"""`taskschema schema` and `taskschema hash`: what a run has learned."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from taskschema_learner.cli.output import Json, RunReference, print_json
from taskschema_learner.cli.run_reference import find_run

if TYPE_CHECKING:
    from taskschema.schema import SchemaDocument
    from taskschema_learner.runs.run_folder import RunFolder


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(schema)
    app.command("hash")(print_hash)


def schema(
    run: RunReference,
    as_json: Json = False,
    compare_paper: Annotated[
        bool,
        typer.Option(
            "--compare-paper",
            help="Say in words whether it is the paper's schema, as good as it, or neither.",
        ),
    ] = False,
    export: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the schema to a signed file, for --init-schema anywhere."),
    ] = None,
    good_schemas: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Compare with the good set that `taskschema audit --good-schemas FILE` wrote. Default: that "
            "of this package, which its own tasks have.",
        ),
    ] = None,
) -> None:
    """Show the task schema that a run has learned: the most probable skill pair of every step."""
    from rich.console import Console

    from taskschema.tasks.registry import task_of
    from taskschema_learner.schemas.schema_explanation import explain
    from taskschema_learner.schemas.schema_report import compare, schema_words
    from taskschema_learner.schemas.schema_table import schema_table

    folder = find_run(run)
    document = folder.read_schema() if export is None else _export(folder, export)
    if as_json:
        print_json(document)
        return
    task = task_of(folder.config)
    comparison = compare(task, document.best, good_schemas)
    if not compare_paper:
        console = Console()
        console.print(schema_table(document.best))
        console.print(f"{document.task}, policy version {document.version}, {document.updated_at}")
    print(f"Schema found: {schema_words(comparison.found)}; {comparison.sentence}.")
    if compare_paper:
        print("\n".join(explain(task, comparison, good_schemas)))


def _export(folder: "RunFolder", path: Path) -> "SchemaDocument":
    """Write the signed file, say on standard error whose signature it is, and return its schema."""
    from taskschema_learner.schemas.schema_file import export_schema
    from taskschema_learner.schemas.signing import PUBLIC_SUFFIX, key_path, owner_key

    written = export_schema(folder, path, owner_key())
    print(
        f"{path}: signed with the key {written.signature.public_key}; who is to check it needs "
        f"{key_path()}{PUBLIC_SUFFIX}.",
        file=sys.stderr,
    )
    return written.schema


def print_hash(run: RunReference) -> None:
    """Print the SHA-256 of a run's newest policy: weights and schema logits. Equal runs have equal hashes."""
    from taskschema_learner.runs.run_hash import run_hash

    print(run_hash(find_run(run)))
