"""What no working camera delivers is refused, frame by frame and on the wire."""

import numpy as np
import pytest
from spatial_setup import TOY, image_config, toy_frames

from taskschema.errors import FrameError, WireError
from taskschema.frames import check_alive, check_colour_order, check_frames
from taskschema.trajectory import Trajectory, TrajectoryFormat, decode_slot, encode_slot

FORMAT = TrajectoryFormat.of(TOY, image_config(episodes_per_slot=2))


def slot(frames, arguments=None):
    """Two failed episodes of three steps whose first frames are the given ones [2, ...]."""
    raw = np.zeros((3, 8), dtype=np.float32) if arguments is None else arguments
    steps = [np.stack([frame] * 3) for frame in frames]
    common = {"pairs": np.zeros(3, dtype=np.int64), "arguments": raw, "success": False}
    return [
        Trajectory(round=0, slot=1, episode=index, observations=observations, **common)
        for index, observations in enumerate(steps)
    ]


def test_frames_travel_as_they_are():
    frames = toy_frames(2)
    decoded = decode_slot(encode_slot(slot(frames)), FORMAT)
    assert decoded[1].observations.dtype == np.uint8
    assert np.array_equal(decoded[1].observations[2], frames[1])


BAD = {
    "another size": (lambda frames: frames[:, ::2, ::2], "shape"),
    "channels first": (lambda frames: np.moveaxis(frames, 3, 1), "shape"),
    "another type": (lambda frames: frames.astype(np.float32) / 255, "dtype|float32"),
    "black": (lambda frames: frames // 255, "black"),
    "frozen": (lambda frames: frames[[0, 0]], "frozen"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_frames_do_not_pass_the_wire(name):
    change, reason = BAD[name]
    with pytest.raises(WireError, match=reason):
        decode_slot(encode_slot(slot(change(toy_frames(2)))), FORMAT)


@pytest.mark.parametrize("cell", [-1.0, 64.0, 3.5])
@pytest.mark.parametrize("column", [0, 4])
def test_a_cell_is_one_of_64(cell, column):
    arguments = np.zeros((3, 8), dtype=np.float32)
    arguments[1, column] = cell
    with pytest.raises(WireError, match="cell"):
        decode_slot(encode_slot(slot(toy_frames(2), arguments)), FORMAT)


def test_each_check_says_what_is_wrong():
    frames = toy_frames(3)
    check_frames(frames)
    check_alive(frames)
    check_colour_order(frames)
    with pytest.raises(FrameError, match="uint8"):
        check_frames(frames / 255)
    with pytest.raises(FrameError, match="rows, columns, RGB"):
        check_frames(frames[:, :128])
    dark = frames.copy()
    dark[1] = 3
    with pytest.raises(FrameError, match="frame 1 is black"):
        check_frames(dark)
    with pytest.raises(FrameError, match="BGR"):
        check_colour_order(frames[..., ::-1])
    check_alive(frames[:1])  # one alone shows nothing
