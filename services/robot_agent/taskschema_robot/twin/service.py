"""A running twin: its world, its two robots and its control server."""

import asyncio
import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, field

from taskschema.arrays import FloatArray
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema_robot.twin.control_server import ControlServer
from taskschema_robot.twin.scene import PrintedMarker, twin_model
from taskschema_robot.twin.twin import Twin, TwinOptions
from taskschema_robot.twin.world import World


@dataclass(frozen=True)
class TwinScene:
    """What stands on the twin's table."""

    name: str
    """Of the object."""
    object_mjcf: str
    """See `taskschema.tasks.scene_task.SceneTask.object_mjcf`."""
    pose: FloatArray
    """[7 + h] of the object at the start: position [m], quaternion w x y z, joints."""
    markers: dict[str, Sequence[PrintedMarker]] = field(default_factory=dict)
    """By the body that they are glued to; `world` is the table."""
    finger_mount: float | None = None
    """Opening between the pads when the fingers' travel is 0 [m]; None: as far closed as the model goes."""


class TwinService:
    """Makes a twin and lets clients reach it; start and stop it in one event loop.

    Args:
        scene: what stands on the table.
        options: how it runs.
        control_port: of the control server; 0: a free one.

    """

    def __init__(self, scene: TwinScene, options: TwinOptions, control_port: int = 0) -> None:
        model = twin_model(scene.name, scene.object_mjcf, scene.markers)
        # Hands start where every task's episodes start: beside the object, well above the table.
        world = World(model, LateralLifting().home_joints, scene.finger_mount)
        world.place_object(scene.pose)
        self.twin = Twin(scene.name, world, options)
        self.control = ControlServer(self.twin, control_port)
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
