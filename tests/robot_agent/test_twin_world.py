"""The twin's world: every object stands still, and the camera's model shows the world that is simulated."""

import mujoco
import numpy as np
import pytest

from taskschema.kinematics.sawyer import GRIPPER_STROKE
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_robot.objects.catalogue import OBJECTS
from taskschema_robot.twin.scene import physics_model, picture_model
from taskschema_robot.twin.service import pose_on_table
from taskschema_robot.twin.twin import FINGER_MOUNT
from taskschema_robot.twin.world import World

HOME = LateralLifting().home_joints


def world_of(name: str) -> World:
    world = World(physics_model(OBJECTS[name]), HOME, FINGER_MOUNT)
    world.place_object(pose_on_table(OBJECTS[name]))
    return world


@pytest.mark.parametrize("name", OBJECTS)
def test_an_object_at_rest_stays_at_rest(name):
    world = world_of(name)
    start = world.object_pose
    for _ in range(400):
        world.step()
    end = world.object_pose
    assert np.linalg.norm(end[:3] - start[:3]) < 0.01
    assert abs(np.dot(end[3:7], start[3:7])) > np.cos(0.5 * 0.05)  # turned by less than 0.05 rad
    assert np.isfinite(world.data.qpos).all()


@pytest.mark.parametrize("name", OBJECTS)
def test_the_camera_sees_the_world_that_is_simulated(name):
    item = OBJECTS[name]
    physics, picture = physics_model(item), picture_model(item)
    assert picture.nq == physics.nq
    joints = [[model.joint(index).name for index in range(model.njnt)] for model in (physics, picture)]
    assert joints[0] == joints[1]
    data = [mujoco.MjData(model) for model in (physics, picture)]
    for model, each in zip((physics, picture), data, strict=True):
        each.qpos[:] = world_of(name).data.qpos
        mujoco.mj_kinematics(model, each)
    for body in ("left_right_l6", "right_r_finger", "object"):
        assert data[0].body(body).xpos == pytest.approx(data[1].body(body).xpos, abs=1e-9)
    for marker in (*item.markers, *item.joint_markers):
        assert picture.geom(f"marker_{marker.number}").matid >= 0


def test_fingers_travel_their_whole_stroke():
    world = world_of("glass-jar")
    assert world.measure(0).finger_travel == pytest.approx(GRIPPER_STROKE, abs=1e-4)
    world.set_fingers(0, 0.0, pressing=True)
    for _ in range(200):
        world.step()
    assert world.measure(0).finger_travel == pytest.approx(0.0, abs=0.001)
    assert world.measure(1).finger_travel > 0.9 * GRIPPER_STROKE


def test_an_obstacle_pushes_back():
    world = world_of("glass-jar")
    assert world.measure(0).contact_force == 0.0
    tool = np.array(world.data.site_xpos[world.arms[0].grip])
    world.place_obstacle(tool - np.array([0.0, 0.04, 0.2]))
    felt = [0.0, 0.0]
    for _ in range(20):
        world.step()
        felt = [max(felt[arm], world.measure(arm).contact_force) for arm in (0, 1)]
    assert felt[0] > 25.0
    assert felt[1] == 0.0
    world.place_obstacle(None)
    for _ in range(60):
        world.step()
    assert world.measure(0).contact_force == 0.0
