"""One simulated robot: its part of the world, its ROS node, and the bridge that its clients reach."""

from collections.abc import Callable

from taskschema_robot.twin.ros.bridge import Bridge
from taskschema_robot.twin.ros.graph import RosGraph
from taskschema_robot.twin.ros.server import BridgeServer
from taskschema_robot.twin.sawyer.joint_control import JointControl
from taskschema_robot.twin.sawyer.node import SawyerNode
from taskschema_robot.twin.world import World
from taskschema_robot.websocket_place import Place

REAL_LINK_DELAY = 0.2
"""How long a new connection between bridge and node takes in real time [s]."""


class TwinRobot:
    """One arm of the world behind its topics.

    Args:
        world: that both arms share.
        arm: 0 left, 1 right.
        now: the twin's time [s since the epoch].
        place: of its bridge.
        link_delay: see `Bridge`.

    """

    def __init__(
        self, world: World, arm: int, now: Callable[[], float], place: Place, link_delay: float
    ) -> None:
        self._world = world
        self._arm = arm
        self._now = now
        self.clock_skew = 0.0
        """By how much the robot's clock is ahead [s]: a fault that can be set."""
        self.stuck = False
        """Whether the fingers stay where they are: a fault that can be set."""
        graph = RosGraph()
        self.control = JointControl(world.arms[arm].kinematics, world.positions(arm))
        self.node = SawyerNode(graph, self.control, now, self.clock)
        self.bridge = Bridge(graph, now, link_delay, stamp=self.clock)
        self.server = BridgeServer(self.bridge, place)
        self._held_travel: float | None = None

    def clock(self) -> float:
        """Return the robot's own time [s since the epoch]."""
        return self._now() + self.clock_skew

    def advance(self, seconds: float) -> None:
        """Run the controllers for one physics step, and give the servos their set-points."""
        self.node.advance(seconds)
        self._world.set_joints(self._arm, self.control.reference, self.control.velocity)
        gripper = self.node.gripper
        if self.stuck:
            if self._held_travel is None:
                self._held_travel = gripper.position
            self._world.set_fingers(self._arm, self._held_travel, pressing=False)
        else:
            self._held_travel = None
            self._world.set_fingers(self._arm, gripper.target, pressing=gripper.closing)

    def publish(self, seconds: float) -> None:
        """Read the sensors and publish; call every `seconds`, at 100 Hz."""
        measured = self._world.measure(self._arm)
        self.node.sense(measured, seconds)
        self.node.publish(measured)
        self.bridge.tick()
