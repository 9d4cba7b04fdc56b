"""The reward from the twin's own pictures: a bar that both hands lift, found by its markers."""

import cv2
import numpy as np
import pytest
from scripted_expert import TASK, Expert
from twin_setup import LockStep

from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.twin_person import TwinPerson
from taskschema_robot.objects.catalogue import HEAVY_BAR
from taskschema_robot.reward.camera_world import CameraWorld
from taskschema_robot.reward.tracker import ObjectTracker
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.twin.camera import LockStepCamera
from taskschema_robot.twin.scene import intrinsics


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("lift", "success"), [(0.35, True), (0.12, False)])
def test_an_episode_is_judged_by_what_the_camera_sees(tmp_path, lift, success):
    twin = LockStep(HEAVY_BAR)
    try:
        limits = SafetyLimits(period=0.02)
        gate = SafetyGate(twin.arms, twin.clock, limits)
        gate.prepare()
        world = CameraWorld(
            LockStepCamera(twin.client, twin.clock),
            ObjectTracker(HEAVY_BAR, intrinsics()),
            TASK,
            HEAVY_BAR,
            TwinPerson(twin.client),
            twin.clock,
            tmp_path,
        )
        runner = EpisodeRunner(TASK, np.array(HEAVY_BAR.size), gate, world, twin.clock, limits)
        trajectory, record = runner.run(EpisodeKey(0, 0, 0, 0), Expert(lift))
        assert trajectory.success is success, record.reason
        assert not record.refusals
        assert cv2.imread(str(tmp_path / record.evidence)).shape == (1080, 1080, 3)
        assert twin.client.object_pose()[2] < 0.05, "it was not put down"
    finally:
        twin.close()
