"""The twin: one world, two robots, a camera, and one clock."""

import asyncio
import time
from dataclasses import dataclass, field

import numpy as np

from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.skills.pairs import ARMS
from taskschema_robot import sawyer_interface as interface
from taskschema_robot.twin.faults import FaultKind
from taskschema_robot.twin.picture import Exposure, PictureTaker
from taskschema_robot.twin.robot import REAL_LINK_DELAY, TwinRobot
from taskschema_robot.twin.world import TIMESTEP, World
from taskschema_robot.websocket_place import Place

STEPS_PER_STATE = 2
PERIOD = STEPS_PER_STATE * TIMESTEP
"""Of the joint states [s]: 100 Hz, the Sawyer's default."""
OBSTACLE_POSITION = (0.0, -0.05, 0.25)
"""Where a person would reach in, between the hands [m]."""
FINGER_MOUNT = rethink_gripper().closed
"""[m] the fingers' narrowest place: the opening then goes to 56 mm, less than the 79 mm of the simulation."""
SILENCED = {
    FaultKind.SILENCE_WRENCH: interface.ENDPOINT_STATE,
    FaultKind.SILENCE_COLLISION: interface.COLLISION_STATE,
}
"""Topics that a fault silences."""
LONGEST_LAG = 0.5
"""[s] by which a world in real time may fall behind before it gives the time up as lost."""


@dataclass(frozen=True)
class TwinOptions:
    """How a twin runs."""

    real_time: bool = True
    """Whether its clock is the machine's; otherwise it stands still until a client asks for time."""
    places: tuple[Place, Place] = (0, 0)
    """Where the robots' bridges listen, left arm first."""
    finger_mount: float = FINGER_MOUNT
    """Opening between the pads with the grippers fully closed [m]: as their fingers are screwed on."""
    calibrated: bool = False
    """Whether the grippers need no calibration: for tests of something else."""
    epoch: float = field(default_factory=time.time)
    """What the clock shows at the start [s since the epoch]."""


class Twin:
    """Two simulated Sawyers in one world.

    Everything happens in one event loop, in a fixed order: in lock-step, a run is a function of the frames
    that the clients send and of the times that they ask for.
    """

    def __init__(self, name: str, world: World, camera: PictureTaker, options: TwinOptions) -> None:
        self.name = name
        """Of its object."""
        self.options = options
        self.world = world
        self._ticks = 0
        delay = REAL_LINK_DELAY if options.real_time else 0.0
        self.robots = tuple(
            TwinRobot(world, arm, self.now, place, delay) for arm, place in enumerate(options.places)
        )
        for robot in self.robots:
            robot.node.gripper.calibrated = options.calibrated
        self.camera = camera

    def now(self) -> float:
        """Return the twin's time [s since the epoch]."""
        return self.options.epoch + self._ticks * TIMESTEP

    async def start(self) -> None:
        """Listen for the robots' clients."""
        for robot in self.robots:
            await robot.server.start()

    async def stop(self) -> None:
        """Close all connections."""
        for robot in self.robots:
            await robot.server.stop()
        self.camera.close()

    def advance_to(self, moment: float) -> None:
        """Simulate until the clock shows `moment` [s since the epoch], or the first step after it."""
        while self.now() < moment - 1e-9:
            for robot in self.robots:
                robot.advance(TIMESTEP)
            self.world.step()
            self._ticks += 1
            if self._ticks % STEPS_PER_STATE == 0:
                for robot in self.robots:
                    robot.publish(PERIOD)

    async def run_real_time(self) -> None:
        """Keep up with the machine's clock, until cancelled."""
        start = time.monotonic() - (self.now() - self.options.epoch)
        while True:
            target = time.monotonic() - start
            behind = target - (self.now() - self.options.epoch)
            if behind > LONGEST_LAG:
                start += behind
                target -= behind
            self.advance_to(self.options.epoch + target)
            await asyncio.sleep(max(PERIOD - (time.monotonic() - start - target), 0.0))

    def expose(self) -> Exposure:
        """Return the overhead camera's newest picture, not yet rendered."""
        return self.camera.expose(self.world.data, self.now())

    def inject(self, kind: FaultKind, arm: int | None, *, active: bool = True, value: float = 0.0) -> None:
        """Cause a fault, or take it back.

        Args:
            kind: of the fault.
            arm: 0 left, 1 right; None: both.
            active: whether it begins or ends.
            value: of the faults that have one.

        """
        if kind is FaultKind.FREEZE_CAMERA:
            self.camera.freeze(self.expose() if active else None)
        elif kind is FaultKind.REPEAT_PICTURE:
            self.camera.repeat(self.expose() if active else None)
        elif kind is FaultKind.OBSTACLE:
            self.world.place_obstacle(np.array(OBSTACLE_POSITION) if active else None)
        else:
            for index in range(len(ARMS)) if arm is None else (arm,):
                _inject_robot(self.robots[index], kind, active=active, value=value)


def _inject_robot(robot: TwinRobot, kind: FaultKind, *, active: bool, value: float) -> None:
    assembly, gripper = robot.node.assembly, robot.node.gripper
    if kind is FaultKind.DROP_CONNECTION and active:
        robot.server.drop_clients()
    elif kind is FaultKind.STALL_CONNECTION:
        robot.server.stall(active=active)
    elif kind is FaultKind.FREEZE_STATE:
        robot.node.frozen = active
    elif kind in SILENCED:
        robot.node.silence(SILENCED[kind], active=active)
    elif kind is FaultKind.LOSE_ACKNOWLEDGEMENT:
        gripper.acknowledges = not active
    elif kind is FaultKind.PRESS_EMERGENCY_STOP:
        (assembly.press_button if active else assembly.release_button)()
    elif kind is FaultKind.STICK_GRIPPER:
        robot.stuck = active
    elif kind is FaultKind.SKEW_CLOCK:
        robot.clock_skew = value if active else 0.0
    elif kind is FaultKind.JOINT_ERROR and active:
        assembly.fail()
