"""The process beside PyRobot: reads requests from standard input, writes states to standard output.

It runs under the interpreter that PyRobot is installed for (Python 3.6 or newer), so it uses nothing but that
interpreter's standard library, PyRobot, and what PyRobot itself needs. Lines of JSON go both ways. PyRobot
names its ROS parameters and nodes globally: one process, and one ROS master, an arm.
"""

import json
import os
import sys
import threading
import time

PERIOD = 0.01
"""Between two states [s]."""
SOURCES = (
    "/robot/limb/right/endpoint_state",
    "/robot/limb/right/collision_detection_state",
    "/robot/state",
    "/io/end_effector/right_gripper/state",
)
"""Topics whose last word PyRobot and the SDK repeat for ever, without saying how old it is."""


class Arm:
    """One Sawyer by PyRobot's calls."""

    def __init__(self) -> None:
        import intera_interface
        import rospy
        from pyrobot import Robot
        from sensor_msgs.msg import JointState

        self._robot = Robot("sawyer", use_base=False, use_camera=False)
        self._fingers = self._robot.gripper.gripper
        self._switches = intera_interface.RobotEnable()
        self._limb = intera_interface.Limb()
        self._stamp = 0.0
        self._acknowledged = 0
        # PyRobot keeps the angles of a joint state but not its time, without which a frozen one looks fresh.
        rospy.Subscriber("/robot/joint_states", JointState, self._joint_states)
        self._turn = threading.Condition()
        self._setpoint = None  # type: object
        threading.Thread(target=self._follow, daemon=True).start()
        self._heard = dict.fromkeys(SOURCES)
        for topic in SOURCES:
            rospy.Subscriber(topic, rospy.AnyMsg, self._hear, callback_args=topic)

    def _joint_states(self, message: object) -> None:
        self._stamp = message.header.stamp.to_sec()  # type: ignore[attr-defined]

    def _hear(self, message: object, topic: str) -> None:
        self._heard[topic] = time.monotonic()

    def _ages(self) -> "dict[str, object]":
        """Return for how long each source has been silent [s]; None: it has said nothing yet."""
        now = time.monotonic()
        return {topic: None if heard is None else now - heard for topic, heard in self._heard.items()}

    def state(self) -> "dict[str, object]":
        """Return what the arm says of itself."""
        arm, switches, fingers = self._robot.arm, self._switches.state(), self._fingers
        effort = self._limb.endpoint_effort()
        return {
            "stamp": self._stamp,
            "ages": self._ages(),
            "positions": list(arm.get_joint_angles()),
            "velocities": list(arm.get_joint_velocities()),
            "efforts": list(arm.get_joint_torques()),
            "wrench": list(effort["force"]) + list(effort["torque"]),
            "collision": bool(arm.get_collision_state()),
            "enabled": switches.enabled,
            "stopped": switches.stopped,
            "error": switches.error,
            "button": switches.estop_button,
            "travel": fingers.get_position(),
            "calibrated": fingers.is_calibrated(),
            "moving": fingers.is_moving(),
            "gripping": fingers.is_gripping(),
            "gripper_error": fingers.has_error(),
            "acknowledged": self._acknowledged,
        }

    def do(self, request: "dict[str, object]") -> None:
        """Carry a request out in another thread, so that none holds up a stop.

        Of the set-points only the newest waits for its turn, and none that came before a stop.
        """
        operation = request["op"]
        if operation in ("command", "stop"):
            with self._turn:
                self._setpoint = request.get("positions")
                self._turn.notify()
        if operation != "command":
            threading.Thread(target=self._slow, args=(operation, request), daemon=True).start()

    def _follow(self) -> None:
        """Make the newest set-point, again and again."""
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._setpoint is not None)
                positions, self._setpoint = self._setpoint, None
            self._robot.arm.set_joint_positions(positions, plan=False, wait=False)

    def _slow(self, operation: object, request: "dict[str, object]") -> None:
        if operation == "gripper":
            # Returns once the gripper has acknowledged, or after five seconds.
            self._robot.gripper.open(position=request["travel"], wait=False)
            self._acknowledged = request["number"]  # type: ignore[assignment]
        elif operation == "speed":
            self._limb.set_joint_position_speed(request["ratio"])
        elif operation == "calibrate":
            self._fingers.calibrate()
        elif operation in ("enable", "disable", "reset", "stop"):
            getattr(self._switches, str(operation))()


def main() -> None:
    """Serve until standard input ends: the agent has gone, and the arm stays where it is."""
    # Libraries print what they like: the protocol gets a descriptor of its own.
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    arm = Arm()

    def report() -> None:
        while True:
            start = time.monotonic()
            out.write(json.dumps(arm.state()) + "\n")
            out.flush()
            time.sleep(max(start + PERIOD - time.monotonic(), 0.0))

    threading.Thread(target=report, daemon=True).start()
    for line in sys.stdin:
        arm.do(json.loads(line))


if __name__ == "__main__":
    main()
