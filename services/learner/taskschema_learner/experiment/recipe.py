"""What each cell of an experiment is: its config, and what `taskschema train` is told about it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

import msgspec

from taskschema.config import PolicyKind, RunConfig, SchemaConfig
from taskschema.errors import ExperimentError
from taskschema.schema import logits_from_document
from taskschema.tasks.registry import get_task
from taskschema_learner.default_config import default_config
from taskschema_learner.experiment.cell import Cell
from taskschema_learner.schemas.schema_file import read_schema


class Recipe(Protocol):
    """What the cells of an experiment are made from."""

    def config(self, cell: Cell) -> RunConfig:
        """Return the config that the cell's run has."""
        ...

    def options(self, cell: Cell) -> list[str]:
        """Return the options that give `taskschema train TASK --seed N` this config."""
        ...


class PaperSim:
    """Learning from states: the paper's method, its baseline and the oracle, with the defaults."""

    def config(self, cell: Cell) -> RunConfig:
        """Return the defaults of the task and policy."""
        return default_config(cell.task, cast(PolicyKind, cell.policy), cell.seed)

    def options(self, cell: Cell) -> list[str]:
        """Return the policy."""
        return ["--policy", cell.policy]


@dataclass(frozen=True)
class ImagesSim:
    """Learning from images: `transferred`, with a schema learned from states, or `re-learned` from images."""

    schemas: Path
    """Folder of `TASK.json`, which `taskschema schema RUN --export` wrote."""

    def schema_of(self, cell: Cell) -> Path:
        """Return where the task's schema is.

        Raises:
            ExperimentError: if there is none.
        """
        path = self.schemas / f"{cell.task}.json"
        if not path.is_file():
            raise ExperimentError(
                f"{path} is missing: train {cell.task} on states, then write its schema there with "
                f"`taskschema schema RUN --export {path}`."
            )
        return path

    def config(self, cell: Cell) -> RunConfig:
        """Return the defaults on images, with the schema given and frozen where it is transferred.

        Raises:
            TaskschemaError: if the schema is missing, or does not fit the task.
        """
        config = msgspec.structs.replace(default_config(cell.task, "schema", cell.seed), observation="image")
        if cell.policy != "transferred":
            return config
        task = get_task(cell.task)
        logits = logits_from_document(read_schema(self.schema_of(cell)), task.pairs, task.horizon)
        schema = SchemaConfig(initial_logits=tuple(map(tuple, logits.tolist())), frozen=True)
        return msgspec.structs.replace(config, schema=schema)

    def options(self, cell: Cell) -> list[str]:
        """Return the observation, and the schema where it is transferred."""
        words = ["--observation", "image"]
        if cell.policy == "transferred":
            words += ["--init-schema", str(self.schema_of(cell)), "--freeze-schema"]
        return words
