"""Trajectories, and their bounded, typed encoding on the wire."""

from dataclasses import dataclass

import msgspec
import numpy as np

from taskschema.arrays import AnyArray, Float32Array, IntArray
from taskschema.config import RunConfig
from taskschema.errors import FrameError, WireError
from taskschema.frames import FRAME_DTYPE, FRAME_SHAPE, check_alive, check_frames
from taskschema.policies.spatial_layout import CELL, CELLS, SpatialLayout
from taskschema.skills.pairs import ARMS
from taskschema.tasks.task import Task

MAX_MESSAGE_BYTES = 16 * 1024 * 1024
"""No trajectory message is larger: 3 frames of 256 x 256 x 3 bytes and 4 episodes fit many times over."""
MAX_COUNTER = 2**40
"""No counter is larger."""
MAX_RAW_ARGUMENT = 1e6
"""No raw sample is larger: the search space is +-1, and the log-probability squares it in float32."""


@dataclass(frozen=True)
class Trajectory:
    """One episode of L <= T steps and its sparse binary outcome."""

    round: int
    """Round, equal to the policy version that acted."""
    slot: int
    episode: int
    """Episode within its slot."""
    observations: AnyArray
    """[L, D] float32 SI observations before each step, or [L, 256, 256, 3] uint8 frames."""
    pairs: IntArray
    """[L] skill pair of each step."""
    arguments: Float32Array
    """[L, A] raw Gaussian samples; 0 where the pair does not use the argument. On images [L, R], see
    `taskschema.policies.spatial_layout`."""
    success: bool
    diverged: bool = False
    """Whether the simulation broke down; then it is a failure."""
    attempt: int = 0
    """Times this episode was dropped before by a fault of a robot."""
    physics_steps: int = 0
    refused: int = 0
    """Steps that a safety gate refused: nothing moved."""

    def __len__(self) -> int:
        """Return L, the number of steps executed."""
        return len(self.pairs)


class _Array(msgspec.Struct, frozen=True, forbid_unknown_fields=True, array_like=True):
    dtype: str
    shape: tuple[int, ...]
    data: bytes


class _Message(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    round: int
    slot: int
    episode: int
    observations: _Array
    pairs: _Array
    arguments: _Array
    success: bool
    diverged: bool
    attempt: int
    physics_steps: int
    refused: int = 0  # a robot's own log may hold episodes from before there was this field


class _SlotMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    trajectories: list[_Message]


def _pack(array: AnyArray, dtype: str) -> _Array:
    contiguous = np.ascontiguousarray(array, dtype=dtype)
    return _Array(dtype, contiguous.shape, contiguous.tobytes())


def _unpack(packed: _Array, name: str, dtype: str, shape: tuple[int | None, ...]) -> AnyArray:
    """Return the array if it has the dtype and shape expected (None matches any length)."""
    if packed.dtype != dtype:
        raise WireError(f"{name}: dtype {packed.dtype[:20]!r}, expected {dtype!r}")
    fits = len(packed.shape) == len(shape) and all(
        wanted is None or wanted == given for wanted, given in zip(shape, packed.shape, strict=True)
    )
    if not fits:
        raise WireError(f"{name}: shape {packed.shape[:8]}, expected {shape}")
    count = 1
    for size in packed.shape:
        if size < 0:
            raise WireError(f"{name}: negative shape")
        count *= size
    if len(packed.data) != count * np.dtype(dtype).itemsize:
        raise WireError(f"{name}: {len(packed.data)} bytes do not make shape {packed.shape[:8]}")
    array = np.frombuffer(packed.data, dtype=dtype).reshape(packed.shape)
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise WireError(f"{name}: not finite", kind="not_finite")
    return array


@dataclass(frozen=True)
class TrajectoryFormat:
    """What a run's trajectories look like; everything else is refused."""

    horizon: int
    pair_count: int
    argument_count: int
    observation_shape: tuple[int, ...]
    observation_dtype: str
    episodes_per_slot: int

    cell_columns: tuple[int, ...] = ()
    """Of actions on images: which numbers are cells of the table; they are whole, 0 to 63."""

    @classmethod
    def of(cls, task: Task, config: RunConfig) -> "TrajectoryFormat":
        """Return the format of a run's trajectories."""
        common = (task.horizon, len(task.pairs))
        if config.observation == "image":
            layout = SpatialLayout(task.image_pairs)
            cells = tuple(layout.columns(arm).start + CELL for arm in range(len(ARMS)))
            return cls(*common, layout.size, FRAME_SHAPE, FRAME_DTYPE, config.episodes_per_slot, cells)
        shape = (task.observation.size,)
        return cls(*common, task.pairs.argument_count, shape, "<f4", config.episodes_per_slot)


def encode_slot(trajectories: list[Trajectory]) -> bytes:
    """Encode one slot's trajectories."""
    messages = [
        _Message(
            round=item.round,
            slot=item.slot,
            episode=item.episode,
            observations=_pack(item.observations, item.observations.dtype.str),
            pairs=_pack(item.pairs, "<i8"),
            arguments=_pack(item.arguments, "<f4"),
            success=item.success,
            diverged=item.diverged,
            attempt=item.attempt,
            physics_steps=item.physics_steps,
            refused=item.refused,
        )
        for item in trajectories
    ]
    return msgspec.msgpack.encode(_SlotMessage(messages))


_DECODER = msgspec.msgpack.Decoder(_SlotMessage)


def decode_slot(data: bytes, expected: TrajectoryFormat) -> list[Trajectory]:
    """Decode and check one slot's trajectories, in the order of their episodes.

    Raises:
        WireError: if anything about the message is not as `expected`; its text is the reason.
    """
    if len(data) > MAX_MESSAGE_BYTES:
        raise WireError(f"{len(data)} bytes are more than {MAX_MESSAGE_BYTES}", kind="oversized")
    try:
        message = _DECODER.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise WireError(f"malformed message: {str(error)[:200]}") from None
    trajectories = [_check(item, expected) for item in message.trajectories]
    if [item.episode for item in trajectories] != list(range(expected.episodes_per_slot)):
        raise WireError(f"a slot holds episodes 0 to {expected.episodes_per_slot - 1}, in order")
    if len({(item.round, item.slot) for item in trajectories}) != 1:
        raise WireError("a message holds one slot of one round")
    if expected.observation_dtype == FRAME_DTYPE:
        _check_pictures(trajectories)
    return trajectories


def _check_pictures(trajectories: list[Trajectory]) -> None:
    """Refuse what no working camera delivers."""
    try:
        for item in trajectories:
            check_frames(item.observations)
        check_alive(np.stack([item.observations[0] for item in trajectories]))
    except FrameError as error:
        raise WireError(f"observations: {error}", kind="bad_frame") from None


def _check(message: _Message, expected: TrajectoryFormat) -> Trajectory:
    pairs = _unpack(message.pairs, "pairs", "<i8", (None,))
    length = len(pairs)
    if not 1 <= length <= expected.horizon:
        raise WireError(f"{length} steps, expected 1 to {expected.horizon}")
    if pairs.min() < 0 or pairs.max() >= expected.pair_count:
        raise WireError(f"pair outside 0 to {expected.pair_count - 1}")
    if message.success and message.diverged:
        raise WireError("a diverged episode cannot be a success")
    if not message.success and not message.diverged and length != expected.horizon:
        raise WireError(f"a failed episode has {expected.horizon} steps, got {length}")
    if message.refused > length:
        raise WireError(f"{message.refused} refused steps of {length}")
    counters = (
        message.round,
        message.slot,
        message.episode,
        message.attempt,
        message.physics_steps,
        message.refused,
    )
    if min(counters) < 0 or max(counters) > MAX_COUNTER:
        raise WireError(f"counter outside 0 to {MAX_COUNTER}")
    observations = _unpack(
        message.observations,
        "observations",
        expected.observation_dtype,
        (length, *expected.observation_shape),
    )
    arguments = _unpack(message.arguments, "arguments", "<f4", (length, expected.argument_count))
    if (np.abs(arguments) > MAX_RAW_ARGUMENT).any():
        raise WireError(f"arguments: beyond +-{MAX_RAW_ARGUMENT:g}")
    cells = arguments[:, list(expected.cell_columns)]
    if ((cells != np.floor(cells)) | (cells < 0) | (cells >= CELLS)).any():
        raise WireError(f"arguments: a cell is a whole number from 0 to {CELLS - 1}")
    return Trajectory(
        round=message.round,
        slot=message.slot,
        episode=message.episode,
        observations=observations,
        pairs=pairs,
        arguments=arguments,
        success=message.success,
        diverged=message.diverged,
        attempt=message.attempt,
        physics_steps=message.physics_steps,
        refused=message.refused,
    )
