"""How the schema's logits are trained, by name; a new way is a file here and a line in the registry."""

from collections.abc import Callable

from taskschema.config import SchemaConfig
from taskschema.errors import UnknownNameError
from taskschema_learner.schema_trainers.algorithm1 import Algorithm1
from taskschema_learner.schema_trainers.schema_trainer import SchemaTrainer

SCHEMA_TRAINERS: dict[str, Callable[[SchemaConfig], SchemaTrainer]] = {
    item.name: item for item in (Algorithm1,)
}

__all__ = ["SCHEMA_TRAINERS", "Algorithm1", "SchemaTrainer", "make_schema_trainer"]


def make_schema_trainer(config: SchemaConfig) -> SchemaTrainer:
    """Return the trainer that the config names.

    Raises:
        UnknownNameError: if there is none of this name.

    """
    if config.trainer not in SCHEMA_TRAINERS:
        raise UnknownNameError("schema trainer", config.trainer, SCHEMA_TRAINERS)
    return SCHEMA_TRAINERS[config.trainer](config)
