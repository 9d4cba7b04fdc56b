"""The task schema: a T x |X| array of logits over skill pairs that does not depend on the state."""

from dataclasses import dataclass

import msgspec
import numpy as np

from taskschema.arrays import AnyArray, FloatArray, IntArray
from taskschema.errors import SchemaMismatchError
from taskschema.skills.pairs import PairSpace


def softmax(logits: AnyArray) -> FloatArray:
    """Return probabilities over the last axis of logits [..., |X|]."""
    shifted = np.asarray(logits, dtype=np.float64)
    shifted = shifted - shifted.max(axis=-1, keepdims=True)
    weights = np.exp(shifted)
    probabilities: FloatArray = weights / weights.sum(axis=-1, keepdims=True)
    return probabilities


def entropy(logits: AnyArray) -> FloatArray:
    """Return the entropy [nat] of each row of logits [..., |X|]: [...]."""
    probabilities = softmax(logits)
    logs = np.log(np.where(probabilities > 0, probabilities, 1.0))
    result: FloatArray = -(probabilities * logs).sum(axis=-1)
    return result


def one_hot_logits(pairs: IntArray, horizon: int, pair_count: int) -> FloatArray:
    """Return logits [T, |X|] that choose the given pairs [at most T] for certain; further rows are uniform.

    -1e9 stands for impossible, so that the array stays finite on the wire.
    """
    logits = np.zeros((horizon, pair_count))
    for step, pair in enumerate(pairs):
        logits[step] = -1e9
        logits[step, pair] = 0.0
    return logits


class BestPair(msgspec.Struct, frozen=True):
    """The most probable skill pair of one step."""

    t: int
    """Step, from 1 as in the paper's Table I."""
    left: str
    right: str
    probability: float
    used: bool
    """False for rows after the step at which episodes succeed: those are not trained towards anything."""


class SchemaDocument(msgspec.Struct, frozen=True):
    """A schema as `GET /schema` answers it and `schema.json` holds it (docs/api.md)."""

    run: str
    task: str
    version: int
    """Policy version: the number of updates behind it."""
    horizon: int
    skills: dict[str, list[str]]
    pairs: list[tuple[str, str]]
    logits: list[list[float]]
    probabilities: list[list[float]]
    best: list[BestPair]
    entropy: list[float]
    """Entropy of each row [nat]."""
    updated_at: str
    """UTC time of the update, ISO 8601."""


@dataclass(frozen=True)
class SchemaView:
    """Logits together with the pairs that they are about."""

    pairs: PairSpace
    logits: FloatArray
    """[T, |X|]"""

    def __post_init__(self) -> None:
        if self.logits.ndim != 2 or self.logits.shape[1] != len(self.pairs):
            raise SchemaMismatchError(
                f"Schema logits have shape {self.logits.shape}, this task has |X| = {len(self.pairs)} pairs."
            )

    def best(self, used_steps: int | None = None) -> list[BestPair]:
        """Return the most probable pair of every step; rows from `used_steps` on count as unused."""
        probabilities = softmax(self.logits)
        limit = len(self.logits) if used_steps is None else used_steps
        result = []
        for step, row in enumerate(probabilities):
            index = int(row.argmax())
            left, right = self.pairs.pairs[index]
            result.append(BestPair(step + 1, left, right, float(row[index]), used=step < limit))
        return result

    def document(
        self, *, run: str, task: str, version: int, used_steps: int | None, updated_at: str
    ) -> SchemaDocument:
        """Return the document that the API and the run's folder show."""
        names = [skill.name for skill in self.pairs.skills]
        return SchemaDocument(
            run=run,
            task=task,
            version=version,
            horizon=len(self.logits),
            skills={"left": names, "right": list(names)},
            pairs=list(self.pairs.pairs),
            logits=self.logits.tolist(),
            probabilities=softmax(self.logits).tolist(),
            best=self.best(used_steps),
            entropy=entropy(self.logits).tolist(),
            updated_at=updated_at,
        )


def logits_from_document(document: SchemaDocument, pairs: PairSpace, horizon: int) -> FloatArray:
    """Return the logits [T, |X|] of a schema learned elsewhere, if they fit this task.

    Raises:
        SchemaMismatchError: if horizon or skill pairs differ; the message says how.
    """
    if document.horizon != horizon:
        raise SchemaMismatchError(
            f"The schema has horizon {document.horizon}, this task has {horizon}: they must be equal."
        )
    if [tuple(pair) for pair in document.pairs] != list(pairs.pairs):
        names = [skill.name for skill in pairs.skills]
        raise SchemaMismatchError(
            f"The schema is about the skills {document.skills.get('left')}, this task allows {names}: "
            "they must be equal, in the same order."
        )
    logits = np.array(document.logits, dtype=np.float64)
    if logits.shape != (horizon, len(pairs)) or not np.isfinite(logits).all():
        raise SchemaMismatchError(
            f"The schema's logits must be finite, of shape {(horizon, len(pairs))}, got {logits.shape}."
        )
    return logits
