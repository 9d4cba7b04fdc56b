"""The interface of a schema trainer."""

from collections.abc import Sequence
from typing import ClassVar, Protocol

from taskschema.arrays import FloatArray
from taskschema.trajectory import Trajectory


class SchemaTrainer(Protocol):
    """What moves the schema's logits after a round."""

    name: ClassVar[str]
    """Name in `config.schema.trainer`."""

    def update(self, logits: FloatArray, trajectories: Sequence[Trajectory]) -> FloatArray:
        """Return new logits [T, |X|] from the old ones and a round's trajectories; changes neither."""
        ...
