"""The policy snapshot: its hash covers every bit, and nothing altered is taken."""

import numpy as np
import pytest
from bus_setup import toy_snapshot
from hypothesis import given, settings
from hypothesis import strategies as st

from taskschema.errors import WireError
from taskschema.policies import PolicySnapshot

SNAPSHOT = toy_snapshot(4)
DATA = SNAPSHOT.to_bytes()


def test_round_trip() -> None:
    again = PolicySnapshot.from_bytes(DATA)
    assert (again.version, again.sha256) == (4, SNAPSHOT.sha256)
    np.testing.assert_array_equal(again.logits, SNAPSHOT.logits)
    assert again.weights.keys() == SNAPSHOT.weights.keys()


def test_hash_does_not_depend_on_the_order_of_arrays() -> None:
    turned = dict(reversed(SNAPSHOT.weights.items()))
    assert PolicySnapshot(4, turned, SNAPSHOT.logits).sha256 == SNAPSHOT.sha256


def test_hash_does_not_depend_on_the_layout_in_memory() -> None:
    weights = {name: np.asfortranarray(array) for name, array in SNAPSHOT.weights.items()}
    assert PolicySnapshot(4, weights, SNAPSHOT.logits).sha256 == SNAPSHOT.sha256
    assert PolicySnapshot.from_bytes(PolicySnapshot(4, weights, SNAPSHOT.logits).to_bytes()).sha256


@given(st.sampled_from(sorted(SNAPSHOT.weights)), st.data())
def test_hash_covers_every_number(name: str, data: st.DataObject) -> None:
    index = tuple(data.draw(st.integers(0, size - 1)) for size in SNAPSHOT.weights[name].shape)
    changed = SNAPSHOT.weights[name].copy()
    changed[index] = np.nextafter(changed[index], np.float32(10))
    assert PolicySnapshot(4, SNAPSHOT.weights | {name: changed}, SNAPSHOT.logits).sha256 != SNAPSHOT.sha256


def test_hash_covers_names_shapes_and_logits() -> None:
    logits = SNAPSHOT.logits.copy()
    logits[2, 8] += 1e-9
    others = [
        PolicySnapshot(4, SNAPSHOT.weights, logits),
        PolicySnapshot(4, SNAPSHOT.weights, SNAPSHOT.logits.reshape(9, 3)),
        PolicySnapshot(4, SNAPSHOT.weights, SNAPSHOT.logits.astype(np.float32)),
        PolicySnapshot(4, SNAPSHOT.weights | {"more": np.zeros(1, np.float32)}, SNAPSHOT.logits),
    ]
    assert len({SNAPSHOT.sha256, *(other.sha256 for other in others)}) == 5


def refused(data: bytes) -> None:
    with pytest.raises(WireError) as caught:
        PolicySnapshot.from_bytes(data)
    assert "\n" not in str(caught.value)


@settings(max_examples=200)
@given(st.integers(0, len(DATA) - 1), st.integers(1, 255))
def test_every_altered_byte_is_noticed(position: int, change: int) -> None:
    altered = bytearray(DATA)
    altered[position] ^= change
    try:
        again = PolicySnapshot.from_bytes(bytes(altered))
    except WireError:
        return
    # Only the version and the padding of the header stand outside the hash.
    assert again.sha256 == SNAPSHOT.sha256


@settings(max_examples=200)
@given(st.binary(max_size=200))
def test_noise(data: bytes) -> None:
    refused(data)


@given(st.integers(0, len(DATA) - 1))
def test_truncated(length: int) -> None:
    refused(DATA[:length])


@pytest.mark.parametrize(
    "header",
    [
        b"{}",
        b'{"__metadata__":{"version":"1"}}',
        b'{"__metadata__":{"version":"x","sha256":"y"}}',
        b'{"schema.logits":{"dtype":"BF16","shape":[1],"data_offsets":[0,2]}}',
        b'{"schema.logits":{"dtype":"F8_E4M3","shape":[2],"data_offsets":[0,2]},"__metadata__":{"version":"1"}}',
        b'{"__metadata__":{"version":"' + b"9" * 5_000 + b'"},'
        b'"schema.logits":{"dtype":"F32","shape":[0],"data_offsets":[0,0]}}',
    ],
)
def test_strange_headers(header: bytes) -> None:
    refused(len(header).to_bytes(8, "little") + header + b"\x00\x00")
    refused(len(header).to_bytes(8, "little") + header)
