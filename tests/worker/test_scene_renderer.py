"""Pictures show what is there: the overhead camera looks straight down, and shows nothing that is hidden."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest
from rendering_setup import needs_renderer

from taskschema.errors import RenderingError
from taskschema.frames import FRAME_SIZE
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema.tasks.registry import get_task
from taskschema.tasks.scene_task import ObjectInstance
from taskschema.visual_scene import OVERHEAD_HEIGHT, OVERHEAD_VIEW
from taskschema_worker.rendering import backend
from taskschema_worker.rendering.scene_renderer import SceneRenderer

pytestmark = needs_renderer
SCENE_TASKS = ("lateral-lifting", "picking", "opening", "rotating")
ALONG_X, ALONG_Y = (1.0, 0.0, 0.0, 0.0), (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))


def bar(x, y, density=7000.0, quaternion=ALONG_X):
    return ObjectInstance(position=(x, y, 0.0225), quaternion=quaternion, density=density)


@pytest.fixture(scope="module")
def renderer():
    with SceneRenderer(LateralLifting(), FRAME_SIZE, FRAME_SIZE) as renderer:
        yield renderer


def shot(renderer, instance, arms_away=False):
    positions = renderer.home_positions.copy()
    if arms_away:  # turned about their bases, both arms leave the picture
        positions[[0, 9]] = np.pi / 2
    positions[-7:] = instance.pose
    renderer.set_object(instance)
    return renderer.render(positions)


def bar_centre(frame, empty):
    """Return the centre of what differs from the empty table, in pixels from the picture's middle."""
    rows, columns = np.nonzero(np.abs(frame.astype(int) - empty).sum(axis=2) > 40)
    assert len(rows) > 100
    middle = 0.5 * (FRAME_SIZE - 1)
    return columns.mean() - middle, middle - rows.mean()


@pytest.mark.parametrize(
    ("x", "y", "quaternion"), [(0.0, 0.15, ALONG_X), (0.0, -0.1, ALONG_X), (0.2, 0.0, ALONG_Y)]
)
def test_the_overhead_camera_looks_straight_down_with_x_right_and_y_up(renderer, x, y, quaternion):
    # The bar's top is 45 mm above the table: 256 pixels are 0.8 m x (1.25 - 0.045) / 1.25 there. Off the
    # middle its side shows, too: at 0.2 m that is 2.4 pixels more towards the middle, 1.2 for their mean.
    scale = FRAME_SIZE / (OVERHEAD_VIEW * (OVERHEAD_HEIGHT - 0.045) / OVERHEAD_HEIGHT)
    empty = shot(renderer, bar(5.0, 0.0), arms_away=True)
    across, up = bar_centre(shot(renderer, bar(x, y, quaternion=quaternion), arms_away=True), empty)
    assert across == pytest.approx(scale * x, abs=2.0)
    assert up == pytest.approx(scale * y, abs=2.0)


def test_frames_show_what_moves_and_nothing_that_is_hidden(renderer):
    first = shot(renderer, bar(0.02, 0.03))
    assert first.shape == (FRAME_SIZE, FRAME_SIZE, 3)
    assert first.dtype == np.uint8
    assert first.std() > 10  # neither black nor of one colour
    np.testing.assert_array_equal(first, shot(renderer, bar(0.02, 0.03, density=6800.0)))
    assert (first != shot(renderer, bar(0.02, 0.05))).any()
    np.testing.assert_array_equal(first, shot(renderer, bar(0.02, 0.03)))


def test_the_arms_leave_the_object_in_sight_when_the_first_step_is_decided(renderer):
    positions = renderer.home_positions.copy()
    positions[-7:] = bar(0.0, 0.0).pose
    assert renderer.object_pixels(positions) > 100
    assert renderer.object_pixels(positions) == renderer.object_pixels(positions, arms=False)
    # Under the left hand: its 5 cm of fingers before the wrist, of 80 cm that the picture shows.
    positions[-7:] = bar(0.0, -0.2).pose
    assert renderer.object_pixels(positions) < 0.98 * renderer.object_pixels(positions, arms=False)


def test_both_kinds_of_software_rendering_show_the_same(tmp_path):
    script = (
        "import sys, numpy as np\n"
        "from taskschema.tasks.lateral_lifting import LateralLifting\n"
        "from taskschema_worker.rendering.scene_renderer import SceneRenderer\n"
        "with SceneRenderer(LateralLifting(), 64, 64, 'front') as renderer:\n"
        "    np.save(sys.argv[1], renderer.render(renderer.home_positions))\n"
    )
    frames = []
    for name in backend.BACKENDS:
        if backend.probe(name)[0] is None:
            pytest.skip(f"no {name} here")
        path = tmp_path / f"{name}.npy"
        result = subprocess.run(
            [sys.executable, "-c", script, path],
            env=backend.environment_for(name),
            capture_output=True,
            text=True,
        )
        assert (result.returncode, result.stderr) == (0, "")
        frames.append(np.load(path).astype(int))
    assert np.abs(frames[0] - frames[1]).mean() < 2.0


def test_a_machine_without_a_renderer_is_told_what_to_install(monkeypatch):
    backend.working_backend.cache_clear()
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json")  # glvnd finds no driver
    monkeypatch.setenv("MUJOCO_GL", "egl")
    with pytest.raises(RenderingError, match=r"No renderer works here .*apt-get install libegl1"):
        SceneRenderer(LateralLifting(), 32, 32)
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    with pytest.raises(RenderingError, match="MUJOCO_GL=glfw cannot draw off screen: set it to"):
        SceneRenderer(LateralLifting(), 32, 32)
    monkeypatch.undo()
    backend.working_backend.cache_clear()


@pytest.mark.parametrize("camera", ["overhead", "close"])
@pytest.mark.parametrize("name", SCENE_TASKS)
def test_what_is_not_drawn_is_not_seen(name, camera):
    task, rng = get_task(name), np.random.default_rng(0)
    with SceneRenderer(task, 128, 128, camera) as renderer:
        seen, hidden = renderer._seen, 0
        for index in range(6):
            positions = renderer.home_positions.copy()
            positions[[0, 1, 3, 9, 10, 12]] += rng.uniform(-0.6, 0.6, 6)
            instance = task.draw_instance(generator(EpisodeKey(0, 0, 0, index), Purpose.RESET))
            positions[-len(instance.pose) :] = instance.pose
            renderer.set_object(instance)
            renderer._seen = seen
            quick = renderer.render(positions)
            hidden += (renderer._instance.geom_group != renderer._model.geom_group).sum()
            renderer._seen = None
            renderer._instance.geom_group[:] = renderer._model.geom_group
            renderer._scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = True
            assert np.array_equal(quick, renderer.render(positions))
    assert hidden > 0
