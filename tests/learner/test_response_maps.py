"""Pictures of response maps: what is drawn where, and who has none."""

import numpy as np
import pytest
from spatial_setup import TOY, image_config, some_policy

from taskschema.config import RunConfig
from taskschema.errors import ConfigError, RunFolderError
from taskschema.tasks.registry import get_task
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_learner.views.response_maps import examples, map_extent, opacity, plot_response_maps


@pytest.fixture
def folder(tmp_path):
    made = RunFolder.create(tmp_path / "pictures", image_config())
    made.write_policy(some_policy().snapshot.to_bytes())
    return made


def test_examples_are_held_out_frames_with_both_arms_maps(folder):
    shown = examples(folder, 2)
    policy = some_policy()
    for example in shown:
        assert example.frame.shape == (256, 256, 3)
        assert example.maps == pytest.approx(policy.response_maps(example.frame[None])[0], rel=1e-4)
    assert not np.array_equal(shown[0].frame, shown[1].frame)


def test_a_picture_is_written(folder):
    path = folder.path / "response_maps.png"
    plot_response_maps(folder, path)
    assert path.read_bytes().startswith(b"\x89PNG")


def test_the_map_lies_where_its_cells_are_on_the_table():
    # 256 pixels show 0.8 m; the map covers +-0.18 m, 57.6 pixels on each side of the middle
    assert map_extent(get_task("lateral-lifting")) == pytest.approx((70.4, 185.6, 185.6, 70.4))
    # the toy's frames show 0.26 m, its map +-0.1 m
    assert map_extent(TOY)[0] == pytest.approx(128 - 256 * 0.1 / 0.26)


def test_likely_cells_hide_more():
    even = opacity(np.full((8, 8), 1 / 64))
    assert even.max() == even.min() == pytest.approx(0.1)
    response = np.zeros((8, 8))
    response[2, 3] = 1.0
    assert opacity(response)[2, 3] == pytest.approx(0.8)


def test_runs_without_maps_say_so(tmp_path, folder):
    states = RunFolder.create(tmp_path / "states", RunConfig(task="toy"))
    with pytest.raises(RunFolderError, match="no policy yet"):
        examples(states)
    states.write_policy(folder.read_policy())
    with pytest.raises(ConfigError, match="sees states"):
        examples(states)
