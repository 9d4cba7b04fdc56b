"""Acting on frames: shapes of the paper's figure, where actions lie on the table, what they depend on."""

import numpy as np
import pytest
from spatial_setup import FAMILIES, TOY, family_pairs, some_policy, some_weights, streams, toy_frames

from taskschema.errors import ConfigError
from taskschema.policies.spatial_layout import CELL, GRID, OFFSET_X, OFFSET_Y, SpatialLayout
from taskschema.policies.spatial_trunk import FEATURE_GRID, TRUNKS, maps_layer, squeeze_layer, table_sampling
from taskschema.schema import one_hot_logits, softmax
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import SKILLS
from taskschema.skills.table_space import TableRectangle
from taskschema.tasks.registry import get_task


@pytest.mark.parametrize("family", FAMILIES)
def test_filters_are_those_of_the_papers_figure(family):
    _, others, filters = FAMILIES[family]
    layout = SpatialLayout(family_pairs(family))
    assert len(layout.others) == others
    assert layout.map_count == filters
    assert maps_layer(layout.map_count).shape == (filters, 16, 1, 1)
    assert squeeze_layer("vgg16").shape == (16, 512, 2, 2)
    assert squeeze_layer("vgg16").stride == 2
    assert SpatialLayout(get_task(family.replace("_", "-")).image_pairs).map_count == filters


@pytest.mark.parametrize("trunk", TRUNKS)
def test_trunks_leave_maps_that_halve_to_8_by_8(trunk):
    size = 256
    for layer in TRUNKS[trunk]:
        reach = layer.dilation * (layer.kernel - 1) + 1
        size = (size + 2 * layer.padding - reach) // layer.stride + 1
        size //= 2 if layer.pooled else 1
    assert size == FEATURE_GRID == 2 * GRID


def test_the_map_covers_every_place_of_the_object_and_10_cm_around_it():
    assert get_task("lateral-lifting").table == TableRectangle((-0.18, 0.18), (-0.18, 0.18))
    assert get_task("opening").table == TableRectangle((-0.16, 0.16), (-0.16, 0.16))
    assert get_task("picking").table == TableRectangle((-0.18, 0.18), (-0.14, 0.14))
    for argument in get_task("rotating").image_pairs.arguments:
        assert argument.name != "z"  # a location on the table has no height
        if argument.name in ("x", "y"):
            assert (argument.low, argument.high) == (-0.16, 0.16)


def test_a_cell_and_an_offset_are_a_place_on_the_table():
    layout = SpatialLayout(family_pairs("opening"))  # x within +-0.18, y within +-0.16
    raw = np.zeros((3, layout.size))
    raw[0, [CELL, OFFSET_X, OFFSET_Y]] = 0, 0.0, 0.0  # the top left cell's centre
    raw[1, [CELL, OFFSET_X, OFFSET_Y]] = 7, 1.0, -1.0  # the top right cell: its right edge, its lower one
    raw[2, [CELL, OFFSET_X, OFFSET_Y]] = 17, 5.0, 0.5  # third row, second column; clipped to the cell
    arguments = layout.to_si(raw)
    names = layout.pairs.argument_names
    x, y = (arguments[:, names.index(f"left.side_grasp.{axis}")] for axis in "xy")
    # cells are 0.36 / 8 = 0.045 m wide and 0.32 / 8 = 0.04 m high
    assert x == pytest.approx([-0.18 + 0.0225, 0.18, -0.18 + 2 * 0.045])
    assert y == pytest.approx([0.16 - 0.02, 0.16 - 0.04, 0.16 - 2.5 * 0.04 + 0.25 * 0.04])
    assert np.array_equal(x, arguments[:, names.index("left.top_grasp.x")])  # shared by the arm's skills


def test_only_what_the_pairs_skills_take_belongs_to_an_action():
    layout = SpatialLayout(family_pairs("opening"))
    pairs = layout.pairs
    assert layout.others == ("top_grasp.z_orientation", "side_grasp.approach_angle")
    used = layout.used[pairs.index("top_grasp", "twist")]
    assert used.tolist() == [True, True, True, True, False] + 5 * [False]
    lifting = SpatialLayout(family_pairs("lateral_lifting"))
    used = lifting.used[lifting.pairs.index("lift", "top_grasp")]
    # a distance is read at the cell that was drawn, so that the cell is part of a lift, its offset is not
    assert used.tolist() == [True, False, False, False, True, True, True, True, True, False]


def test_features_are_read_off_where_the_cells_lie():
    rectangle = TableRectangle((-0.1, 0.2), (0.0, 0.3))
    rows, columns = table_sampling(rectangle, view=0.8)
    place = (np.arange(16) + 0.5) / 16
    x_of_feature = np.tile(-0.4 + 0.8 * place, (16, 1))
    y_of_feature = np.tile((0.4 - 0.8 * place)[:, None], (1, 16))
    assert (rows @ x_of_feature @ columns.T)[0] == pytest.approx(-0.1 + 0.3 * place, abs=1e-6)
    assert (rows @ y_of_feature @ columns.T)[:, 0] == pytest.approx(0.3 - 0.3 * place, abs=1e-6)


def test_a_frames_action_is_the_same_to_the_bit_whoever_shares_its_batch():
    policy, frames = some_policy(), toy_frames(5)
    together = policy.act(frames, 1, streams(5))
    for index, stream in enumerate(streams(5)):
        alone = policy.act(frames[index : index + 1], 1, [stream])
        assert alone.raw.tobytes() == together.raw[index : index + 1].tobytes()
        assert alone.pairs[0] == together.pairs[index]


def test_cells_are_drawn_with_the_maps_probabilities():
    logits = one_hot_logits(TOY.paper_pairs, 3, 9)
    policy = some_policy(logits=logits)
    frame, count = toy_frames(1), 400
    drawn = np.concatenate([policy.act(frame, 0, streams(1, seed)).raw for seed in range(count)])
    maps = policy.response_maps(frame)[0].reshape(2, -1)
    for arm in (0, 1):
        cells = drawn[:, policy.layout.columns(arm)][:, CELL].astype(int)
        share = np.bincount(cells, minlength=64) / count
        deviation = np.sqrt(maps[arm] * (1.0 - maps[arm]) / count)
        assert (np.abs(share - maps[arm]) <= 5.0 * deviation + 1e-3).all()


def test_offsets_and_arguments_are_read_at_the_cell_that_was_drawn():
    logits = one_hot_logits(TOY.paper_pairs, 3, 9)
    policy, frames = some_policy(logits=logits), toy_frames(2)
    output = policy._network.forward(frames)
    mean = policy.act_mean(frames, 0)
    cells = output.response.argmax(axis=2)
    for index in range(2):
        for arm in (0, 1):
            part = mean.raw[index, policy.layout.columns(arm)]
            assert part[CELL] == cells[index, arm]
            assert np.array_equal(part[OFFSET_X:3], output.mean[index, arm, :2, cells[index, arm]])
    assert softmax(output.response[0, 0]).max() > 1.5 / 64  # or the cell would hardly matter


def test_only_the_frame_and_the_schema_matter():
    """What is hidden and when it is reach the policy through the frame or not at all."""
    policy, environment = some_policy(), TOY.make_environment()
    from taskschema_worker.image_environment import ImageEnvironment

    seen = ImageEnvironment(TOY, environment)
    frames = seen.reset(streams(3))
    before = policy.act(frames, 1, streams(3))
    environment._time += 1  # hidden: shown to a policy on states
    again = environment.frames(np.arange(3))
    assert np.array_equal(again, frames)
    after = policy.act(again, 1, streams(3))
    assert after.raw.tobytes() == before.raw.tobytes()
    assert np.array_equal(policy.act_mean(frames, 0).raw, policy.act_mean(frames, 2).raw)
    environment._handles += 0.03  # shown
    moved = policy.act_mean(environment.frames(np.arange(3)), 1)
    assert not np.array_equal(moved.raw, policy.act_mean(frames, 1).raw)


def test_a_task_without_locations_cannot_act_on_images():
    with pytest.raises(ConfigError, match="location"):
        SpatialLayout(PairSpace([SKILLS["lift"], SKILLS["no_op"]], TableRectangle.around((0.0, 0.0))))


def test_the_trunk_sees_each_frame_once_to_act():
    policy = some_policy()
    policy.act(toy_frames(4), 0, streams(4))
    assert policy.trunk_passes == 4
    assert some_weights()["maps.weight"].shape[0] == 8  # 2 + 4 + 2 * 1: the toy has one other argument
