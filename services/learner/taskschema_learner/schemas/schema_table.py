"""A task schema as a table for the terminal."""

from rich.table import Table

from taskschema.schema import BestPair, SchemaView, softmax


def schema_table(best: list[BestPair], schema: SchemaView | None = None) -> Table:
    """Return a schema as a table, one row per step; with `schema`, also the second most probable pairs."""
    table = Table("step", "left arm", "right arm", "probability", title="Task schema", title_justify="left")
    if schema is not None:
        table.add_column("next")
    for item in best:
        cells = [str(item.t), item.left, item.right, f"{item.probability:6.1%}"]
        if schema is not None:
            cells.append(_runner_up(schema, item.t - 1))
        note = "" if item.used else " (unused: episodes are over by then)"
        cells[3] += note
        table.add_row(*cells, style=None if item.used else "dim")
    return table


def _runner_up(schema: SchemaView, step: int) -> str:
    probabilities = softmax(schema.logits)[step]
    if len(probabilities) < 2:
        return ""
    index = int(probabilities.argsort()[-2])
    left, right = schema.pairs.pairs[index]
    return f"{left}, {right} {probabilities[index]:.1%}"
