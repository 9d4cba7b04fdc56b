"""The task's scene in robosuite: its two Sawyers, its table, its joint controllers, and the task's bar."""

import contextlib
import io
import logging
import warnings

import numpy as np

from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.tasks.lateral_lifting import BAR_SIZE, FRICTION
from taskschema.tasks.scene_task import ObjectInstance

TABLE_HEIGHT = 0.8
CONTROL_RATE = 20
"""[Hz] robosuite's default."""

logging.getLogger("robosuite_logs").setLevel(logging.CRITICAL)
with contextlib.redirect_stderr(io.StringIO()), warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from robosuite.controllers import load_composite_controller_config, load_part_controller_config
    from robosuite.environments.manipulation.two_arm_env import TwoArmEnv
    from robosuite.models.arenas import TableArena
    from robosuite.models.objects import BoxObject
    from robosuite.models.tasks import ManipulationTask


class BarLift(TwoArmEnv):
    """robosuite's two opposed Sawyers at its table, with the bar; no reward, the usual observations."""

    def __init__(self, instance: ObjectInstance, home: np.ndarray, *, lite_physics: bool) -> None:
        self._instance = instance
        self._home = home
        controller = load_composite_controller_config(robot="Sawyer")
        arm = load_part_controller_config(default_controller="JOINT_POSITION")
        controller["body_parts"]["right"] = arm | {"input_type": "absolute", "gripper": {"type": "GRIP"}}
        super().__init__(
            robots=["Sawyer", "Sawyer"],
            env_configuration="opposed",
            controller_configs=[controller, controller],
            base_types="default",
            initialization_noise=None,
            use_camera_obs=False,
            has_renderer=False,
            has_offscreen_renderer=False,
            control_freq=CONTROL_RATE,
            lite_physics=lite_physics,
            hard_reset=False,
            ignore_done=True,
        )

    def reward(self, action: object = None) -> float:
        return 0.0

    def _check_success(self) -> bool:
        return False

    def _load_model(self) -> None:
        super()._load_model()
        for robot, turn in zip(self.robots, (np.pi / 2, -np.pi / 2), strict=True):
            x, _, z = robot.robot_model.base_xpos_offset["table"](0.8)
            robot.robot_model.set_base_xpos((0.0, x if turn > 0 else -x, z))
            robot.robot_model.set_base_ori((0.0, 0.0, turn))
        arena = TableArena(table_full_size=(0.8, 0.8, 0.05), table_offset=(0, 0, TABLE_HEIGHT))
        arena.set_origin([0, 0, 0])
        self.bar = BoxObject(
            name="bar",
            size=[0.5 * edge for edge in BAR_SIZE],
            density=self._instance.density,
            friction=[FRICTION, 0.005, 0.0001],
        )
        self.model = ManipulationTask(
            mujoco_arena=arena,
            mujoco_robots=[robot.robot_model for robot in self.robots],
            mujoco_objects=self.bar,
        )

    def _reset_internal(self) -> None:
        super()._reset_internal()
        for robot, joints in zip(self.robots, self._home, strict=True):
            robot.set_robot_joint_positions(joints)
        pose = self._instance.pose + [0, 0, TABLE_HEIGHT, 0, 0, 0, 0]
        self.sim.data.set_joint_qpos(self.bar.joints[0], pose)

    def arm_joints(self) -> np.ndarray:
        """Return measured joint angles [2, 7]."""
        return np.stack([self.sim.data.qpos[robot._ref_joint_pos_indexes] for robot in self.robots])


def action(joints: np.ndarray, opening: np.ndarray) -> np.ndarray:
    """Return robosuite's action of joint set-points [2, 7] and gripper set-points [2]."""
    grip = np.where(opening < rethink_gripper().open, 1.0, -1.0)
    return np.concatenate([np.append(joints[arm], grip[arm]) for arm in range(2)])
