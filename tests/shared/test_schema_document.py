"""Schemas: probabilities, entropy and the document that travels."""

import math

import msgspec
import numpy as np
import pytest
from bus_setup import TOY
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from taskschema.errors import SchemaMismatchError
from taskschema.schema import (
    SchemaDocument,
    SchemaView,
    entropy,
    logits_from_document,
    one_hot_logits,
    softmax,
)

logits_3_by_9 = arrays(np.float64, (3, 9), elements=st.floats(-1e9, 1e9))


def document(logits: np.ndarray, used_steps: int | None = None) -> SchemaDocument:
    view = SchemaView(TOY.pairs, logits)
    return view.document(run="r", task="toy", version=3, used_steps=used_steps, updated_at="now")


@given(logits_3_by_9)
def test_probabilities_and_entropy(logits: np.ndarray) -> None:
    probabilities = softmax(logits)
    np.testing.assert_allclose(probabilities.sum(axis=-1), 1.0)
    assert (probabilities >= 0).all()
    assert (entropy(logits) >= 0).all()
    assert (entropy(logits) <= math.log(9) + 1e-12).all()


@given(logits_3_by_9, st.floats(-1e3, 1e3))
def test_a_constant_changes_nothing(logits: np.ndarray, constant: float) -> None:
    shifted = np.round(logits / 1e7) + round(constant)
    np.testing.assert_allclose(softmax(shifted), softmax(np.round(logits / 1e7)))


def test_by_hand() -> None:
    # e^0 : e^(ln 3) = 1 : 3; the entropy is ln 4 - 3/4 ln 3
    np.testing.assert_allclose(softmax(np.array([0.0, math.log(3)])), [0.25, 0.75])
    assert entropy(np.array([0.0, math.log(3)])) == pytest.approx(math.log(4) - 0.75 * math.log(3))
    assert entropy(np.zeros(9)) == pytest.approx(math.log(9))


def test_one_hot() -> None:
    logits = one_hot_logits(np.array([2, 5]), 3, 9)
    probabilities = softmax(logits)
    assert probabilities[0].tolist() == [0, 0, 1, 0, 0, 0, 0, 0, 0]
    assert probabilities[1, 5] == 1
    np.testing.assert_allclose(probabilities[2], 1 / 9)
    assert np.isfinite(logits).all()


@given(logits_3_by_9)
def test_document_brings_the_logits_back(logits: np.ndarray) -> None:
    received = msgspec.json.decode(msgspec.json.encode(document(logits)), type=SchemaDocument)
    np.testing.assert_array_equal(logits_from_document(received, TOY.pairs, 3), logits)


def test_best_pairs_by_name() -> None:
    logits = one_hot_logits(TOY.paper_pairs, 3, 9)
    best = document(logits, used_steps=2).best
    assert [(row.t, row.left, row.right) for row in best[:2]] == [
        (1, "reach", "reach"),
        (2, "raise", "raise"),
    ]
    assert [row.used for row in best] == [True, True, False]
    assert all(row.used for row in document(logits).best)


def test_schema_of_another_task_is_refused() -> None:
    good = document(np.zeros((3, 9)))
    with pytest.raises(SchemaMismatchError, match="horizon 3, this task has 2"):
        logits_from_document(good, TOY.pairs, 2)
    with pytest.raises(SchemaMismatchError, match="same order"):
        logits_from_document(msgspec.structs.replace(good, pairs=good.pairs[::-1]), TOY.pairs, 3)
    with pytest.raises(SchemaMismatchError, match="finite"):
        logits_from_document(msgspec.structs.replace(good, logits=[[math.nan] * 9] * 3), TOY.pairs, 3)
    with pytest.raises(SchemaMismatchError, match="9 pairs"):
        SchemaView(TOY.pairs, np.zeros((3, 8)))
