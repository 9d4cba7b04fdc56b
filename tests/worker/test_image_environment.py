"""Frames as observations: what is seen, what is hidden, and that skills go where the table says."""

import dataclasses
from contextlib import closing

import gymnasium
import numpy as np
import pytest
from rendering_setup import needs_renderer
from spatial_setup import TOY, image_config, some_policy, streams
from threadpoolctl import threadpool_limits

import taskschema_worker  # noqa: F401 - registers the environments
from taskschema.errors import ConfigError, FrameError, UnknownNameError
from taskschema.frames import FRAME_SIZE, check_alive, check_colour_order, check_frames
from taskschema.policies import ImagePolicy, PolicySnapshot
from taskschema.policies.spatial_layout import SpatialLayout
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema.tasks.registry import get_task
from taskschema.tasks.table_arguments import offset_arguments
from taskschema.trajectory import Trajectory, TrajectoryFormat, decode_slot, encode_slot
from taskschema_learner.networks.initial_weights import initial_spatial_weights
from taskschema_worker.environments import make_environment
from taskschema_worker.image_environment import ImageEnvironment
from taskschema_worker.rendering.looks import Looks
from taskschema_worker.rendering.scene_renderer import SceneRenderer
from taskschema_worker.rollout import collect_slots

BAR = LateralLifting()


def resets(count):
    return [generator(EpisodeKey(7, 0, 0, episode), Purpose.RESET) for episode in range(count)]


def test_locations_become_offsets_from_where_the_object_is_now():
    task = get_task("rotating")
    table = task.image_pairs
    si = np.arange(float(table.argument_count))[None] / 100.0
    anchors = np.array([[0.05, -0.02, 0.04]])
    offsets = offset_arguments(task, si, anchors)[0]
    names, images = task.pairs.argument_names, table.argument_names
    for name, offset in zip(names, offsets, strict=True):
        if name.endswith(".z"):
            assert offset == 0.04  # the height is the skill's own
        else:
            given = si[0, images.index(name)]
            shift = {".x": 0.05, ".y": -0.02}.get(name[-2:], 0.0)
            assert offset == pytest.approx(given - shift)


def test_a_toy_episode_is_the_same_seen_from_above():
    """The bar's centre is the table's, so that locations and offsets are equal there."""
    state, image = TOY.make_environment(), make_environment(TOY, observation="image")
    first = state.reset(resets(4))
    frames = image.reset(resets(4))
    assert frames.shape == (4, 256, 256, 3)
    expert = TOY.expert_arguments(first, 0)
    for step, pair in enumerate(TOY.paper_pairs):
        episodes, pairs = np.arange(4), np.full(4, pair)
        expected = state.step(episodes, pairs, expert)
        found = image.step(episodes, pairs, expert)
        assert np.array_equal(found.success, expected.success)
        assert found.success.all() == (step == 1)


def test_equal_frames_within_an_episode_are_honest():
    """Here both hands miss: they are no sign of a frozen camera, and pass the wire."""
    environment = make_environment(TOY, observation="image")
    first, pairs = environment.reset(resets(2)), np.full(2, TOY.pairs.index("reach", "reach"))
    result = environment.step(np.arange(2), pairs, np.full((2, TOY.image_pairs.argument_count), 1.0))
    assert np.array_equal(result.observations, first)
    common = {"round": 0, "slot": 0, "success": False, "pairs": np.repeat(pairs[:1], 3)}
    raw = np.zeros((3, SpatialLayout(TOY.image_pairs).size), dtype=np.float32)
    episodes = [
        Trajectory(episode=index, observations=np.stack([frame] * 3), arguments=raw, **common)
        for index, frame in enumerate(first)
    ]
    config = image_config(episodes_per_slot=2)
    assert len(decode_slot(encode_slot(episodes), TrajectoryFormat.of(TOY, config))) == 2


class Broken:
    """A toy environment whose camera fails."""

    def __init__(self, change):
        self._environment, self._change = TOY.make_environment(), change

    def __getattr__(self, name):
        return getattr(self._environment, name)

    def frames(self, episodes):
        return self._change(self._environment.frames(episodes))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda frames: frames * 0, "black"),
        (lambda frames: frames[..., ::-1], "BGR"),
        (lambda frames: frames[:, :100], "shape"),
        (lambda frames: frames / 255.0, "uint8"),
    ],
)
def test_a_broken_camera_is_seen_at_once(change, reason):
    with pytest.raises(FrameError, match=reason):
        ImageEnvironment(TOY, Broken(change)).reset(resets(2))


def test_a_task_that_cannot_be_drawn_says_so():
    class Blind(type(TOY)):
        def make_environment(self, threads=1):
            environment = super().make_environment(threads)
            return type("Environment", (), {"close": environment.close})()

    with pytest.raises(ConfigError, match="has no pictures"):
        make_environment(Blind(), observation="image")


def test_gymnasium_shows_frames_and_nothing_else():
    environment = gymnasium.make("taskschema/Toy-v0", obs_type="image")
    assert environment.observation_space == gymnasium.spaces.Box(0, 255, (256, 256, 3), np.uint8)
    frame, info = environment.reset(seed=1)
    assert frame in environment.observation_space
    assert info == {}
    environment.action_space.seed(1)
    frame, *_ = environment.step(environment.action_space.sample())
    assert frame in environment.observation_space
    assert "left.reach.x [m]" in environment.unwrapped.argument_names
    many = gymnasium.make_vec("taskschema/Toy-v0", num_envs=2, obs_type="image")
    frames, _ = many.reset(seed=1)
    assert frames in many.observation_space
    many.action_space.seed(1)
    assert many.step(many.action_space.sample())[0] in many.observation_space
    with pytest.raises(UnknownNameError, match="image, state"):
        gymnasium.make("taskschema/Toy-v0", obs_type="sound")


@needs_renderer
def test_what_is_hidden_does_not_change_the_action():
    """Density and velocities are hidden; the bar's place is seen."""
    environment = make_environment(BAR, observation="image")
    rng = np.random.default_rng(0)
    weights = initial_spatial_weights(rng, image_config(), BAR)
    weights["maps.weight"] = rng.normal(0.0, 1.0, weights["maps.weight"].shape).astype(np.float32)
    policy = ImagePolicy(PolicySnapshot(0, weights, np.zeros((3, 9))), BAR, "small")
    scene = environment._environment
    try:
        frames = environment.reset(resets(2))
        check_frames(frames)
        check_alive(frames)
        check_colour_order(frames)
        before = policy.act(frames, 0, streams(2))
        scene._simulation.velocities += 0.5
        scene._time += 1
        scene._instances[0] = dataclasses.replace(scene._instances[0], density=1.0)
        again = scene.frames(np.arange(2))
        assert np.array_equal(again, frames)
        assert policy.act(again, 2, streams(2)).raw.tobytes() == before.raw.tobytes()
        scene._simulation.positions[:, scene._simulation.indices.object_pose.start] += 0.05
        moved = scene.frames(np.arange(2))
        assert not np.array_equal(policy.act_mean(moved, 0).raw, policy.act_mean(frames, 0).raw)
    finally:
        environment.close()


@needs_renderer
def test_the_expert_lifts_the_bar_from_places_on_the_table():
    environment = make_environment(BAR, observation="image")
    scene = environment._environment
    try:
        environment.reset(resets(2))
        for step, pair in enumerate(BAR.paper_pairs):
            episodes = np.arange(2)
            offsets = BAR.expert_arguments(scene._observe(episodes), step)
            centres = scene.pose_anchors(episodes)
            table = offsets.copy()
            for column, name in enumerate(BAR.pairs.argument_names):
                if name[-2:] in (".x", ".y"):
                    table[:, column] += centres[:, "xy".index(name[-1])]
            result = environment.step(episodes, np.full(2, pair), table)
        assert result.success.all()
    finally:
        environment.close()


@needs_renderer
def test_a_renderer_that_is_stuck_is_found_as_soon_as_an_arm_moves(monkeypatch):
    environment = make_environment(BAR, observation="image")
    still, away = BAR.pairs.index("no_op", "no_op"), BAR.pairs.index("lift", "lift")
    with closing(environment):
        picture = environment.reset(resets(2))[1]
        monkeypatch.setattr(environment._environment._renderer, "render", lambda positions: picture)
        episodes, arguments = np.arange(2), np.full((2, BAR.image_pairs.argument_count), 0.1)
        environment.step(episodes[1:], np.array([still]), arguments[1:])  # honest, if it draws the right one
        with pytest.raises(FrameError, match=r"frame 1 is the same .* moved by 10 cm: the camera is frozen"):
            environment.step(episodes, np.array([still, away]), arguments)
        environment.reset(resets(2))  # begins anew: an episode has nothing to do with the one before


@needs_renderer
def test_a_step_in_which_nothing_moves_may_show_the_same_frame():
    environment = make_environment(BAR, observation="image")
    with closing(environment):
        first = environment.reset(resets(2))
        pairs = np.full(2, BAR.pairs.index("no_op", "no_op"))
        arguments = np.zeros((2, BAR.image_pairs.argument_count))
        assert np.array_equal(environment.step(np.arange(2), pairs, arguments).observations, first)


def test_an_episode_is_the_same_to_the_bit_on_any_number_of_threads():
    policy = some_policy()
    found = []
    for threads in (1, 2):
        with threadpool_limits(limits=threads):
            slots = collect_slots(
                make_environment(TOY, observation="image"),
                policy,
                seed=5,
                round_index=0,
                slots=[0],
                episodes_per_slot=2,
                horizon=3,
            )
        found.append(encode_slot(slots[0]))
    assert found[0] == found[1]


@needs_renderer
def test_looks_vary_with_the_episode_and_change_nothing_else():
    keys = [EpisodeKey(0, 0, 0, episode) for episode in range(3)]
    plain = make_environment(BAR, observation="image")
    varied = make_environment(BAR, observation="image", randomise_visuals=True)
    with closing(plain), closing(varied):
        first, frames, others = (
            item.reset([generator(key, Purpose.RESET) for key in keys]) for item in (plain, varied, varied)
        )
        again = varied.reset([generator(keys[2], Purpose.RESET)])
        arguments = BAR.image_pairs.to_si(np.zeros((1, BAR.image_pairs.argument_count)))
        plain.reset([generator(keys[2], Purpose.RESET)])
        steps = [item.step(np.array([0]), BAR.paper_pairs[:1], arguments) for item in (plain, varied)]
    assert np.array_equal(frames, others)
    assert np.array_equal(frames[2:], again)  # whoever shares its batch
    for index in range(3):
        assert np.abs(frames[index].astype(int) - first[index]).mean() > 3.0
    colours = frames[:, 8:24, 8:24].mean(axis=(1, 2))  # a corner of the table
    assert np.ptp(colours, axis=0).min() > 5.0
    assert steps[0].physics_steps == steps[1].physics_steps
    poses = [item._environment._simulation.positions[0] for item in (plain, varied)]
    assert np.array_equal(*poses)


@needs_renderer
def test_the_extremes_of_the_looks_are_still_a_wooden_table_with_an_object_on_it():
    with SceneRenderer(BAR, FRAME_SIZE, FRAME_SIZE) as renderer:
        for end in (-1.0, 1.0):
            ends = np.full(4, end) * np.array([1.0, -1.0, 1.0, 1.0])  # least red, most green and blue
            lights = np.full((2, 4), end)
            looks = Looks(ends, np.full(3, end), end, lights, end, np.full(6, end))
            renderer.set_looks(looks)
            frame = renderer.render(renderer.home_positions)
            check_frames(frame[None])
            check_colour_order(frame[None])
            assert renderer.object_pixels(renderer.home_positions) > 500


def test_a_task_that_draws_its_own_pictures_cannot_vary_them():
    with pytest.raises(ConfigError, match="--randomise-visuals"):
        make_environment(TOY, observation="image", randomise_visuals=True)
