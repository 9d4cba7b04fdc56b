"""Films show what happened, in files that browsers and READMEs play."""

import subprocess
import sys
from contextlib import closing
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from PIL import Image
from rendering_setup import needs_renderer, renders

from taskschema.config import RunConfig
from taskschema.errors import RenderingError
from taskschema.policies import PolicySnapshot
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.schema import SchemaView, one_hot_logits
from taskschema.tasks.registry import get_task
from taskschema_learner.networks.initial_weights import initial_spatial_weights
from taskschema_learner.replay.captions import Captions
from taskschema_learner.replay.film import write_film
from taskschema_learner.replay.recorded_episodes import expert_episodes, run_episodes, scene_of
from taskschema_learner.replay.replay import Look, draw_episodes
from taskschema_learner.runs.run_folder import RunFolder
from taskschema_worker.audit.episodes import expert, run_schema
from taskschema_worker.scene_environment import SceneEnvironment

COMMAND = Path(sys.executable).with_name("taskschema")


@pytest.fixture(scope="module")
def lifted():
    return expert_episodes(get_task("lateral-lifting"), 2, seed=3)


def test_recording_changes_nothing_and_misses_nothing(lifted):
    task = get_task("lateral-lifting")
    draws = [generator(EpisodeKey(3, 0, 0, episode), Purpose.RESET) for episode in range(2)]
    with closing(SceneEnvironment(task)) as environment:
        outcome = run_schema(
            environment, task, task.paper_schema, [task.draw_instance(draw) for draw in draws], expert(task)
        )
        ends = environment._simulation.positions
    assert [episode.success for episode in lifted] == outcome.success.tolist()
    for episode, end in zip(lifted, ends, strict=True):
        assert [(step.left, step.right) for step in episode.steps] == list(task.paper_schema)
        np.testing.assert_array_equal(episode.steps[-1].positions[-1], end)
        moves = np.abs(np.diff([episode.start, *episode.steps[0].positions], axis=0)).max()
        assert moves < 0.1  # radian or metre in 8 ms: no state is left out


@needs_renderer
def test_a_film_runs_in_real_time_and_shows_the_lift(lifted):
    task = get_task("lateral-lifting")
    frames = list(draw_episodes(task, lifted[:1], 12.5, Look("front", 160, 120), "lift"))
    seconds = 0.008 * sum(len(step.positions) for step in lifted[0].steps)
    still = round(0.5 * 12.5) + round(1.2 * 12.5)
    assert len(frames) == pytest.approx(12.5 * seconds + still, abs=2)
    assert all(frame.shape == (120, 160, 3) for frame in frames)
    assert np.abs(frames[-1].astype(int) - frames[0]).mean() > 3  # arms and bar have moved


@pytest.fixture
def frames():
    """Return a white square that moves over grey, 40 frames."""
    film = []
    for number in range(40):
        frame = np.full((96, 128, 3), 90, dtype=np.uint8)
        frame[40:56, 2 * number : 2 * number + 16] = 255
        film.append(frame)
    return film


def test_an_mp4_is_h264_as_browsers_play_it(tmp_path, frames):
    write_film(tmp_path / "film.mp4", frames)
    with av.open(str(tmp_path / "film.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert float(stream.average_rate) == 25
        shown = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
    assert len(shown) == len(frames)
    assert np.abs(shown[-1].astype(int) - frames[-1]).mean() < 6
    data = (tmp_path / "film.mp4").read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")  # plays as it loads


def test_a_gif_keeps_time_and_stays_small(tmp_path, frames):
    write_film(tmp_path / "film.gif", frames)
    film = Image.open(tmp_path / "film.gif")
    assert film.n_frames == len(frames)
    assert film.info["duration"] == 80
    assert film.info["loop"] == 0
    film.seek(39)
    assert np.abs(np.asarray(film.convert("RGB")).astype(int) - frames[-1]).mean() < 3
    assert (tmp_path / "film.gif").stat().st_size < 20_000


def test_captions_are_legible_and_stay_in_the_strip():
    frame = np.full((240, 320, 3), 200, dtype=np.uint8)
    Captions(240).write(frame, "left: top grasp", "step 1 of 2", "right: lift", None)
    assert (frame[:210] == 200).all()
    strip = frame[215:]
    assert (strip.max(axis=2) > 240).sum() > 100  # white letters
    for half in (strip[:, :150], strip[:, 170:]):
        assert (half.max(axis=2) > 240).any()
    solved = np.zeros((240, 320, 3), dtype=np.uint8)
    Captions(240).write(solved, "", "", "", True)
    red, green, _ = (solved[215:, :, channel].max() for channel in range(3))
    assert green > red + 50


def test_a_trained_run_is_shown_and_bad_input_is_one_line(tmp_path):
    train = ["train", "lateral-lifting", "--workers", "0", "--slots", "2", "--rounds", "1", "--api", "none"]
    subprocess.run([COMMAND, *train], cwd=tmp_path, check=True, capture_output=True, timeout=200)
    name = "lateral-lifting-schema-seed0"
    if renders():
        small = ["--episodes", "1", "--width", "96", "--height", "72"]
        made = subprocess.run(
            [COMMAND, "replay", name, *small], cwd=tmp_path, capture_output=True, text=True, timeout=200
        )
        assert made.returncode == 0, made.stderr
        assert f"{name}.mp4: 1 episodes" in made.stdout
        capture = cv2.VideoCapture(str(tmp_path / f"{name}.mp4"))
        assert capture.read()[0]
    for arguments, words in [
        ([], "Name one of: a RUN; a task, --expert TASK"),
        (["--expert", "toy"], "Task 'toy' has no scene"),
        (["--expert", "liftin"], "Unknown task 'liftin'"),
        ([name, "--output", "film.avi"], "film.avi has no ending that is known: use .mp4, .gif, .png"),
        ([name, "--camera", "side"], "Unknown camera 'side'"),
    ]:
        result = subprocess.run(
            [COMMAND, "replay", *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=100
        )
        assert result.returncode == 1
        assert words in result.stderr
        assert len(result.stderr.splitlines()) == 1


@pytest.fixture
def image_run(tmp_path):
    """Return a run on images whose response maps differ from cell to cell."""
    config = RunConfig(task="lateral-lifting", observation="image")
    task, rng = get_task("lateral-lifting"), np.random.default_rng(0)
    weights = initial_spatial_weights(rng, config, task)
    weights["maps.weight"] = rng.normal(0.0, 0.1, weights["maps.weight"].shape).astype(np.float32)
    logits = one_hot_logits(task.paper_pairs, task.horizon, len(task.pairs))
    folder = RunFolder.create(tmp_path / "images", config)
    folder.write_policy(PolicySnapshot(1, weights, logits).to_bytes())
    view = SchemaView(task.pairs, logits)
    about = {"run": "images", "task": task.name, "version": 1, "used_steps": None}
    folder.write_schema(view.document(**about, updated_at="2020-01-01T00:00:00"))
    return folder


@needs_renderer
def test_a_run_on_images_is_shown_from_above_with_its_response_maps(image_run, tmp_path):
    film = tmp_path / "film.png"
    size = ["--width", "120", "--height", "120"]
    command = [COMMAND, "replay", image_run.path, "--camera", "overhead", "--episodes", "1", "--step", "1"]
    made = subprocess.run([*command, *size, "--output", film], capture_output=True, text=True, timeout=200)
    assert made.returncode == 0, made.stderr
    task = get_task("lateral-lifting")
    look = Look("overhead", 120, 120, step=1)
    title = "images, policy version 1"
    plain = list(draw_episodes(task, run_episodes(image_run, 1, mean=True), 25.0, look, title))[-1]
    shown = np.asarray(Image.open(film).convert("RGB"))
    differs = (shown != plain).any(axis=2)
    # 120 pixels show 0.8 m; the maps cover +-0.18 m: 27 pixels on each side of the middle
    inside = np.zeros((120, 120), dtype=bool)
    inside[33:87, 33:87] = True
    assert not (differs & ~inside).any()
    assert differs[inside].mean() > 0.25


def test_a_task_without_a_scene_cannot_be_shown(tmp_path):
    with pytest.raises(RenderingError, match="no scene"):
        scene_of(get_task("toy"))
    with pytest.raises(RenderingError, match="no frame"):
        write_film(tmp_path / "film.gif", [])
