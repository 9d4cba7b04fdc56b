"""The batched physics: agreement with the planner's kinematics, collisions, divergence."""

import mujoco
import numpy as np
import pytest

from taskschema.kinematics.rotation import matrix_to_quaternion, same_hemisphere
from taskschema.kinematics.sawyer import sawyer, sawyer_pair
from taskschema.scene import TIMESTEP
from taskschema.skills.pairs import ARMS
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_worker.scene_environment import SceneEnvironment
from taskschema_worker.scenes import scene_model
from taskschema_worker.simulation import Simulation

TASK = LateralLifting()
SPACE = TASK.pairs
BOTH_GRASP = SPACE.index("top_grasp", "top_grasp")
IDLE = SPACE.index("no_op", "no_op")


@pytest.fixture(scope="module")
def model():
    return scene_model(TASK)


@pytest.fixture
def environment():
    environment = SceneEnvironment(TASK)
    yield environment
    environment.close()


def grasp_arguments(left, right):
    arguments = np.zeros((1, SPACE.argument_count))
    for arm, point in enumerate((left, right)):
        arguments[0, SPACE.columns(arm, 0)] = (*point, 3 * np.pi / 4)
    return arguments


def hands(environment):
    joints = environment._simulation.arm_joints(np.array([0]))
    return [arm.forward(joints[:, index])[0][0] for index, arm in enumerate(sawyer_pair())]


def arm_contacts(model, simulation):
    """Return the depth of the deepest contact between the two arms [m], 0 if there is none."""
    data = mujoco.MjData(model)
    data.qpos[:] = simulation.positions[0]
    mujoco.mj_fwdPosition(model, data)
    deepest = 0.0
    for contact in data.contact[: data.ncon]:
        arms = {model.geom(int(geom)).name.partition("_")[0] for geom in contact.geom}
        if arms == set(ARMS):
            deepest = min(deepest, contact.dist)
    return -deepest


def test_planner_and_simulator_agree_on_where_the_hands_are(model):
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    for _ in range(10):
        joints = rng.uniform(-1.5, 1.5, (2, 7))
        for index, arm in enumerate(ARMS):
            for joint in range(7):
                data.qpos[model.joint(f"{arm}_right_j{joint}").qposadr] = joints[index, joint]
        mujoco.mj_kinematics(model, data)
        for index, (arm, kinematics) in enumerate(zip(ARMS, sawyer_pair(), strict=True)):
            position, rotation = kinematics.forward(joints[index][None])
            site = data.site(f"{arm}_grip")
            np.testing.assert_allclose(position[0], site.xpos, atol=1e-6)
            np.testing.assert_allclose(rotation[0], site.xmat.reshape(3, 3), atol=1e-5)


def test_limits_in_the_scene_are_the_sawyer_s(model):
    efforts = (80, 80, 40, 40, 9, 9, 9)
    for arm in ARMS:
        for joint in range(7):
            item = model.joint(f"{arm}_right_j{joint}")
            np.testing.assert_allclose(item.range, [sawyer().lower[joint], sawyer().upper[joint]])
            np.testing.assert_allclose(model.jnt_actfrcrange[item.id], [-efforts[joint], efforts[joint]])
        for finger in "lr":
            force = model.actuator_forcerange[model.actuator(f"{arm}_{finger}_finger_joint").id]
            np.testing.assert_allclose(force, [-20, 20])


def test_bar_weighs_what_its_density_says():
    simulation = Simulation(TASK, threads=1)
    instance = TASK.draw_instance(np.random.default_rng(0))
    simulation.reset([instance])
    body = simulation._models[0].body("object")
    # 0.9 m x 16 mm x 45 mm are 648 cm^3.
    assert body.mass[0] == pytest.approx(648e-6 * instance.density)
    assert body.inertia[0] == pytest.approx(body.mass[0] / 12 * (0.016**2 + 0.045**2))
    simulation.close()


def test_arms_cannot_pass_through_each_other(environment):
    """Both hands are sent to the same point: they stop at each other, however hard they push."""
    environment.reset([np.random.default_rng(0)])
    deepest = []
    advance = environment._simulation.advance

    def watched(episodes, controls):
        result = advance(episodes, controls)
        deepest.append(arm_contacts(environment._simulation._models[0], environment._simulation))
        return result

    environment._simulation.advance = watched
    environment.step(np.array([0]), np.array([BOTH_GRASP]), grasp_arguments((0, 0), (0, 0)))
    left, right = hands(environment)
    assert max(deepest) > 0.0, "the arms never touched"
    assert max(deepest) < 0.015
    assert np.linalg.norm(left - right) > 0.06


def test_hands_apart_reach_their_points(environment):
    environment.reset([np.random.default_rng(0)])
    centre = environment._simulation.object_poses(np.array([0]))[0, :3]
    environment.step(np.array([0]), np.array([BOTH_GRASP]), grasp_arguments((-0.09, -0.09), (0.09, 0.09)))
    for hand, offset in zip(hands(environment), (-0.09, 0.09), strict=True):
        np.testing.assert_allclose(hand[:2], centre[:2] + offset, atol=2e-3)


def test_arms_follow_their_set_points_within_the_joints_speed(environment):
    """Tracking errors stay small, and no measured joint is faster than the Sawyer's limit."""
    environment.reset([np.random.default_rng(seed) for seed in range(8)])
    episodes = np.arange(8)
    arguments = np.repeat(grasp_arguments((-0.09, -0.09), (0.09, 0.09)), 8, axis=0)
    planned = environment.plan(episodes, np.full(8, BOTH_GRASP), arguments)
    fastest = np.zeros(7)
    advance = environment._simulation.advance

    def watched(rows, controls):
        result = advance(rows, controls)
        fastest[:] = np.maximum(
            fastest, np.abs(environment._simulation.arm_velocities(rows)).max(axis=(0, 1))
        )
        return result

    environment._simulation.advance = watched
    environment.step(episodes, np.full(8, BOTH_GRASP), arguments)
    assert (fastest <= sawyer().velocity).all()
    final = np.swapaxes(planned.final_joints.reshape(2, 8, 7), 0, 1)
    np.testing.assert_allclose(environment._simulation.arm_joints(episodes), final, atol=0.01)


def test_diverging_simulation_is_a_failed_episode_and_touches_no_other(environment):
    generators = [np.random.default_rng(seed) for seed in range(3)]
    environment.reset(generators)
    pairs, arguments = (
        np.full(3, BOTH_GRASP),
        np.repeat(grasp_arguments((-0.09, -0.09), (0.09, 0.09)), 3, axis=0),
    )
    healthy = environment.step(np.arange(3), pairs, arguments)
    environment.reset([np.random.default_rng(seed) for seed in range(3)])
    environment._simulation.velocities[1] = 1e12
    broken = environment.step(np.arange(3), pairs, arguments)
    assert broken.diverged.tolist() == [False, True, False]
    assert not broken.success[1]
    assert np.isfinite(broken.observations).all()
    np.testing.assert_array_equal(broken.observations[[0, 2]], healthy.observations[[0, 2]])


def test_two_no_ops_cost_no_physics(environment):
    before = environment.reset([np.random.default_rng(0)])
    result = environment.step(np.array([0]), np.array([IDLE]), np.zeros((1, SPACE.argument_count)))
    assert result.physics_steps.tolist() == [0]
    timestep = TASK.observation.slices["timestep"]
    before[:, timestep] = [[0, 1, 0]]
    np.testing.assert_array_equal(result.observations, before)


def test_step_ends_when_the_goal_is_reached(environment):
    """A lift of 0.5 m is not simulated to its end: the episode is over at 0.25 m."""
    observations = environment.reset([np.random.default_rng(0)])
    for step, pair in enumerate(TASK.paper_pairs):
        arguments = TASK.expert_arguments(observations, step)
        arguments[:, [3, 7]] = 0.5
        result = environment.step(np.array([0]), np.array([pair]), arguments)
        observations = result.observations
    assert result.success[0]
    # Half the height at 0.45 m/s takes 0.71 s, the whole 1.41 s.
    assert result.physics_steps[0] * TIMESTEP < 0.9


def test_bar_at_rest_stays_at_rest(environment):
    environment.reset([np.random.default_rng(0)])
    start = environment._simulation.object_poses(np.array([0]))
    lift = SPACE.index("lift", "lift")
    environment.step(np.array([0]), np.array([lift]), np.full((1, SPACE.argument_count), 0.3))
    np.testing.assert_allclose(environment._simulation.object_poses(np.array([0])), start, atol=5e-4)


def test_observed_hand_is_the_simulator_s(environment):
    """The observation's end-effector pose belongs to the very joints that are observed."""
    row = environment.reset([np.random.default_rng(0)])
    for index, arm in enumerate(sawyer_pair()):
        position, rotation = arm.forward(environment._simulation.arm_joints(np.array([0]))[:, index])
        quaternion = TASK.observation.get(row, f"{ARMS[index]}.end_effector_quaternion")
        expected = same_hemisphere(matrix_to_quaternion(rotation), quaternion[0])
        np.testing.assert_array_equal(
            TASK.observation.get(row, f"{ARMS[index]}.end_effector_position"), position
        )
        np.testing.assert_allclose(quaternion, expected)
