"""Where an episode's object is to be put."""

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.tasks.scene_task import ObjectInstance
from taskschema_robot.objects.robot_object import RobotObject


def start_pose(item: RobotObject, instance: ObjectInstance) -> FloatArray:
    """Return the pose [7 + h] of an object at the start of an episode: standing at the place drawn.

    The place is the task's draw; what else a task varies (density, friction, size) an object on a real
    table does not.
    """
    x, y = np.clip(instance.position[:2], -np.array(item.location_range), item.location_range)
    height, half = 0.5 * item.size[2], 0.5 * item.yaw
    joints = [0.0] if item.joint_parts else []
    return np.array([x, y, height, np.cos(half), 0.0, 0.0, np.sin(half), *joints])
