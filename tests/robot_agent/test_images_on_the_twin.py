"""Runs on images: the frame that the policy sees, and an episode from frames through gate and sockets."""

import numpy as np
import pytest
from rendering_setup import needs_renderer
from twin_setup import LockStep

from taskschema.config import NetworkConfig, RunConfig
from taskschema.policies import policy_of
from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema.tasks import get_task
from taskschema.trajectory import TrajectoryFormat, decode_slot, encode_slot
from taskschema_learner.learner import Learner
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.frame_observer import FrameObserver
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.camera.camera import Frame
from taskschema_robot.objects.catalogue import HEAVY_BAR
from taskschema_robot.reward.overhead import overhead_view
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.twin.camera import LockStepCamera
from taskschema_robot.twin.scene import intrinsics
from taskschema_robot.twin.service import pose_on_table

TASK = get_task("lateral-lifting")
SIZE = np.array(HEAVY_BAR.size)


@needs_renderer
def test_an_episode_from_images_is_streamed_as_a_worker_streams_it():
    config = RunConfig(
        task=TASK.name,
        policy="oracle",
        observation="image",
        slots=1,
        episodes_per_slot=1,
        network=NetworkConfig(hidden=(8,)),
    )
    policy = policy_of(config, TASK, Learner(config, TASK).snapshot())
    twin = LockStep(HEAVY_BAR)
    try:
        limits = SafetyLimits(period=0.02)
        gate = SafetyGate(twin.arms, twin.clock, limits)
        gate.prepare()
        camera = LockStepCamera(twin.client, twin.clock)
        view = overhead_view(camera, intrinsics(), TASK.table_view, twin.clock)
        runner = EpisodeRunner(
            TASK,
            SIZE,
            gate,
            TrueWorld(twin.client, TASK, HEAVY_BAR, twin.clock),
            twin.clock,
            limits,
            observer=FrameObserver(TASK, SIZE, camera, view, twin.clock),
        )
        trajectory, record = runner.run(EpisodeKey(0, 0, 0, 0), policy)
    finally:
        twin.close()
    assert trajectory.observations.shape == (len(trajectory), 256, 256, 3)
    received = decode_slot(encode_slot([trajectory]), TrajectoryFormat.of(TASK, config))
    np.testing.assert_array_equal(received[0].observations, trajectory.observations)
    assert record.outcome in ("success", "failure")


@needs_renderer
def test_the_table_lies_in_the_frame_as_in_simulation():
    from taskschema_worker.rendering.scene_renderer import SceneRenderer

    twin = LockStep(HEAVY_BAR)
    try:
        twin.client.place_object(pose_on_table(HEAVY_BAR, 0.03, -0.04, 0.1))
        twin.sleep(0.3)
        camera = LockStepCamera(twin.client, twin.clock)
        view = overhead_view(camera, intrinsics(), TASK.table_view, twin.clock)
        seen = view.frame(camera.latest().image)
        positions = np.array(twin.running.twin.world.data.qpos)
    finally:
        twin.close()
    with SceneRenderer(TASK, 256, 256) as renderer:
        expected = renderer.render(positions)
    difference = np.abs(seen.astype(float) - expected.astype(float)).mean(axis=2)
    assert np.median(difference) < 12
    shifted = [np.abs(np.roll(seen, by, axis=(0, 1)).astype(float) - expected).mean() for by in SHIFTS]
    assert np.argmin(shifted) == 0, "the frame is shifted, turned or mirrored"


SHIFTS = [(0, 0), (0, 4), (0, -4), (4, 0), (-4, 0)]


class StillCamera:
    """A camera whose pictures are given."""

    def __init__(self, clock, pictures) -> None:
        self.clock, self.pictures = clock, pictures

    def latest(self) -> Frame:
        image = self.pictures.pop(0) if len(self.pictures) > 1 else self.pictures[0]
        return Frame(self.clock.now(), 0, image)


class PassedOn:
    """A view that shows the camera's picture as it is."""

    def frame(self, picture):
        return picture


class StoppedClock:
    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def sleep_until(self, moment: float) -> None:
        self.time = max(self.time, moment)


def observer(*pictures) -> FrameObserver:
    clock = StoppedClock()
    return FrameObserver(TASK, SIZE, StillCamera(clock, list(pictures)), PassedOn(), clock)


GREY = np.full((256, 256, 3), 120, dtype=np.uint8)


@pytest.mark.parametrize(
    ("picture", "reason"),
    [
        (np.zeros((256, 256, 3), dtype=np.uint8), "black"),
        (GREY[:128], "shape"),
        (GREY.astype(np.float32), "uint8"),
        (GREY + np.array([0, 0, 40], dtype=np.uint8), "BGR"),
    ],
)
def test_a_frame_that_no_working_camera_delivers_drops_the_episode(picture, reason):
    with pytest.raises(EpisodeDroppedError, match=reason):
        observer(picture).observe([], np.zeros(7), 0)


def test_two_episodes_that_begin_with_one_picture_have_a_frozen_camera():
    seen = observer(GREY)
    seen.begin()
    seen.observe([], np.zeros(7), 0)
    seen.observe([], np.zeros(7), 1)  # within an episode nothing need have moved
    seen.begin()
    with pytest.raises(EpisodeDroppedError, match="frozen"):
        seen.observe([], np.zeros(7), 0)


def test_a_camera_without_new_pictures_drops_the_episode():
    seen = observer(GREY)
    seen._camera.latest = lambda: Frame(-1.0, 0, GREY)
    with pytest.raises(EpisodeDroppedError, match="no new picture"):
        seen.observe([], np.zeros(7), 0)


def test_places_on_the_table_become_offsets_from_the_object():
    space = TASK.image_pairs
    arguments = space.to_si(np.full((1, space.argument_count), 0.5, dtype=np.float32))[0]
    pose = np.array([0.03, -0.02, 0.01, 1.0, 0.0, 0.0, 0.0])
    offsets = observer(GREY).skill_arguments(arguments, pose)
    grasp = [skill.name for skill in TASK.pairs.skills].index("top_grasp")
    column, there = TASK.pairs.columns(0, grasp).start, space.columns(0, grasp).start
    np.testing.assert_allclose(offsets[column : column + 2], arguments[there : there + 2] - pose[:2])
