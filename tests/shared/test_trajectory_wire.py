"""The wire format: what is encoded comes back; of anything else only a WireError comes out."""

from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskschema.config import RunConfig
from taskschema.errors import WireError
from taskschema.tasks.toy import Toy
from taskschema.trajectory import MAX_MESSAGE_BYTES, Trajectory, TrajectoryFormat, decode_slot, encode_slot

FORMAT = TrajectoryFormat(
    horizon=3,
    pair_count=9,
    argument_count=6,
    observation_shape=(9,),
    observation_dtype="<f4",
    episodes_per_slot=2,
)


def trajectory(episode: int, /, length: int = 3, seed: int = 0, **changes: Any) -> Trajectory:
    rng = np.random.default_rng((seed, episode))
    fields: dict[str, Any] = {
        "round": 7,
        "slot": 5,
        "episode": episode,
        "observations": rng.standard_normal((length, 9)).astype(np.float32),
        "pairs": rng.integers(9, size=length),
        "arguments": rng.standard_normal((length, 6)).astype(np.float32),
        "success": length < 3,
        "physics_steps": 100 * length,
        "refused": length - 1,
    }
    return Trajectory(**fields | changes)


GOOD = encode_slot([trajectory(0), trajectory(1, length=2)])


def refused(data: bytes) -> str:
    with pytest.raises(WireError) as caught:
        decode_slot(data, FORMAT)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def mutate(change: Any) -> bytes:
    """Encode a message whose plain structure was changed."""
    plain = msgspec.msgpack.decode(GOOD)
    change(plain["trajectories"])
    return msgspec.msgpack.encode(plain)


def test_format_of_a_task() -> None:
    assert TrajectoryFormat.of(Toy(), RunConfig(task="toy", episodes_per_slot=2)) == FORMAT


@given(lengths=st.lists(st.integers(1, 3), min_size=2, max_size=2), seed=st.integers(0, 2**32))
def test_round_trip(lengths: list[int], seed: int) -> None:
    sent = [trajectory(episode, length, seed) for episode, length in enumerate(lengths)]
    received = decode_slot(encode_slot(sent), FORMAT)
    for before, after in zip(sent, received, strict=True):
        for name, value in vars(before).items():
            np.testing.assert_array_equal(value, getattr(after, name), strict=isinstance(value, np.ndarray))
    assert encode_slot(received) == encode_slot(sent)


def test_received_arrays_cannot_be_written() -> None:
    received = decode_slot(GOOD, FORMAT)[0]
    with pytest.raises(ValueError, match="read-only"):
        received.observations[0, 0] = 1.0


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"episode": 3}, "episodes 0 to 1"),
        ({"slot": 4}, "one slot of one round"),
        ({"round": 6}, "one slot of one round"),
        ({"round": -1}, "counter"),
        ({"attempt": 2**41}, "counter"),
        ({"physics_steps": -5}, "counter"),
        ({"refused": -1}, "counter"),
        ({"refused": 4}, "4 refused steps of 3"),
        ({"success": True, "diverged": True}, "diverged"),
        ({"pairs": np.array([0, 1])}, "3 steps, got 2"),
        ({"pairs": np.array([0, 1, 9])}, "pair outside 0 to 8"),
        ({"pairs": np.array([-1, 1, 2])}, "pair outside 0 to 8"),
        ({"pairs": np.zeros(0, dtype=np.int64)}, "0 steps"),
        ({"pairs": np.zeros(4, dtype=np.int64)}, "4 steps"),
        ({"observations": np.zeros((3, 8), dtype=np.float32)}, "observations: shape"),
        ({"observations": np.zeros((3, 9))}, "observations: dtype '<f8'"),
        ({"observations": np.full((3, 9), np.nan, dtype=np.float32)}, "observations: not finite"),
        ({"arguments": np.full((3, 6), np.inf)}, "arguments: not finite"),
        ({"arguments": np.full((3, 6), -2e6)}, "arguments: beyond"),
        ({"arguments": np.zeros((2, 6))}, "arguments: shape"),
        ({"arguments": np.zeros((3, 2, 3))}, "arguments: shape"),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], reason: str) -> None:
    assert reason in refused(encode_slot([trajectory(0, **changes), trajectory(1)]))


@pytest.mark.parametrize(
    "shape", [[-1, 9], [3, -9], [2**62, 2**62], [3, 9, 1], [0, 9], [], [3], [10**9, 9], [1] * 5_000]
)
def test_lying_shapes(shape: list[int]) -> None:
    def lie(items: list[dict[str, Any]]) -> None:
        items[0]["observations"][1] = shape

    refused(mutate(lie))


@pytest.mark.parametrize("dtype", ["O", "|O", "<f8", ">f4", "V4", "", "float32", "<U10", "f4, f4", "\ud800"])
def test_lying_dtypes(dtype: str) -> None:
    def lie(items: list[dict[str, Any]]) -> None:
        items[0]["observations"][0] = dtype.encode(errors="surrogatepass") if dtype == "\ud800" else dtype

    refused(mutate(lie))


def test_data_of_another_length() -> None:
    def cut(items: list[dict[str, Any]]) -> None:
        items[0]["observations"][2] = items[0]["observations"][2][:-1]

    assert "do not make shape" in refused(mutate(cut))


def test_unknown_and_missing_fields() -> None:
    assert "malformed" in refused(mutate(lambda items: items[0].update(extra=1)))
    assert "malformed" in refused(mutate(lambda items: items[0].pop("success")))
    assert "malformed" in refused(msgspec.msgpack.encode({"trajectories": [], "more": 1}))


def test_number_of_episodes() -> None:
    for count in (0, 1, 3):
        refused(encode_slot([trajectory(episode) for episode in range(count)]))


def test_oversized_message_is_not_even_decoded() -> None:
    assert "16777217 bytes are more than" in refused(b"\x81" * (MAX_MESSAGE_BYTES + 1))


def test_deep_nesting() -> None:
    refused(b"\x91" * 100_000)
    refused(b"\x81\xac" + b"trajectories" + b"\x91" * 100_000)


def check(data: bytes) -> None:
    """Whatever comes, it is trajectories of the right format or a WireError."""
    try:
        received = decode_slot(data, FORMAT)
    except WireError:
        return
    for item in received:
        assert np.isfinite(item.observations).all()
        assert np.abs(item.arguments).max() <= 1e6
        assert item.observations.shape == (len(item), 9)


@settings(max_examples=300)
@given(st.binary(max_size=300))
def test_noise(data: bytes) -> None:
    check(data)


@settings(max_examples=500)
@given(
    position=st.integers(0, len(GOOD) - 1),
    length=st.integers(0, 12),
    replacement=st.binary(max_size=12),
)
def test_mutated_messages(position: int, length: int, replacement: bytes) -> None:
    check(GOOD[:position] + replacement + GOOD[position + length :])


@settings(max_examples=100)
@given(st.integers(0, len(GOOD) - 1))
def test_truncated_messages(length: int) -> None:
    refused(GOOD[:length])


anything = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=8)
    | st.binary(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
NAMES = ["round", "slot", "episode", "observations", "pairs", "arguments", "success", "diverged", "attempt"]


@settings(max_examples=500)
@given(name=st.sampled_from([*NAMES, "physics_steps"]), value=anything)
def test_fields_of_any_content(name: str, value: object) -> None:
    check(mutate(lambda items: items[0].update({name: value})))


@settings(max_examples=500)
@given(
    name=st.sampled_from(["observations", "pairs", "arguments"]),
    dtype=st.sampled_from(["<f4", "<i8", "<f8"]) | st.text(max_size=8),
    shape=st.lists(st.integers(-3, 12) | st.integers(-(2**63), 2**63 - 1), max_size=4),
    data=st.binary(max_size=120),
)
def test_arrays_of_any_content(name: str, dtype: str, shape: list[int], data: bytes) -> None:
    check(mutate(lambda items: items[0].update({name: [dtype, shape, data]})))
