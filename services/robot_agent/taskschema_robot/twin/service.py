"""A running twin: its world, its two robots and its control server."""

import asyncio
import contextlib

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.twin.control_server import ControlServer
from taskschema_robot.twin.picture import PictureTaker
from taskschema_robot.twin.scene import physics_model, picture_model
from taskschema_robot.twin.twin import Twin, TwinOptions
from taskschema_robot.twin.world import World
from taskschema_robot.websocket_place import Place


def pose_on_table(robot_object: RobotObject, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> FloatArray:
    """Return the pose [7 + h] of an object that stands on the table, ready for an episode.

    Args:
        robot_object: which one.
        x: of its centre [m].
        y: of its centre [m].
        yaw: how far it is turned from its usual angle [rad].

    """
    half = 0.5 * (robot_object.yaw + yaw)
    joints = [0.0] if robot_object.joint_parts else []
    return np.array([x, y, 0.5 * robot_object.size[2], np.cos(half), 0.0, 0.0, np.sin(half), *joints])


class TwinService:
    """Makes a twin and lets clients reach it; start and stop it in one event loop.

    Args:
        robot_object: what stands on the table, in its middle at first.
        options: how it runs.
        control: where the control server listens.

    """

    def __init__(self, robot_object: RobotObject, options: TwinOptions, control: Place = 0) -> None:
        # Hands start where every task's episodes start: beside the object, well above the table.
        world = World(physics_model(robot_object), LateralLifting().home_joints, options.finger_mount)
        world.place_object(pose_on_table(robot_object))
        camera = PictureTaker(picture_model(robot_object))
        self.twin = Twin(robot_object.name, world, camera, options)
        self.control = ControlServer(self.twin, control)
        self._running: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Listen; in real time, begin to simulate."""
        await self.twin.start()
        await self.control.start()
        if self.twin.options.real_time:
            self._running = asyncio.create_task(self.twin.run_real_time())

    async def stop(self) -> None:
        """End everything."""
        if self._running is not None:
            self._running.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._running
        await self.control.stop()
        await self.twin.stop()
