"""The Sawyer's ROS interface: names and types of its topics, numbers of its modes.

Each robot is its own ROS master and names its arm `right`: two Sawyers are told apart by their address.
Source: RethinkRobotics/intera_common and intera_sdk.
"""

DEFAULT_SPEED_RATIO = 0.3
DEFAULT_COMMAND_TIMEOUT = 0.2
"""[s]"""
POSITION_MODE = 1
VELOCITY_MODE = 2
BUTTON_PRESSED = 1
"""Value of `estop_button`."""

JOINT_NAMES = tuple(f"right_j{joint}" for joint in range(7))

JOINT_STATES = "/robot/joint_states"
ENDPOINT_STATE = "/robot/limb/right/endpoint_state"
COLLISION_STATE = "/robot/limb/right/collision_detection_state"
ROBOT_STATE = "/robot/state"
GRIPPER_STATE = "/io/end_effector/right_gripper/state"
GRIPPER_CONFIGURATION = "/io/end_effector/right_gripper/config"
END_EFFECTOR_CONFIGURATION = "/io/end_effector/config"

JOINT_COMMAND = "/robot/limb/right/joint_command"
SPEED_RATIO = "/robot/limb/right/set_speed_ratio"
COMMAND_TIMEOUT = "/robot/limb/right/joint_command_timeout"
ENABLE = "/robot/set_super_enable"
STOP = "/robot/set_super_stop"
RESET = "/robot/set_super_reset"
GRIPPER_COMMAND = "/io/end_effector/right_gripper/command"

LONGEST_SILENCE = {
    ENDPOINT_STATE: 0.1,
    COLLISION_STATE: 0.5,
    ROBOT_STATE: 0.5,
    GRIPPER_STATE: 2.0,
}
"""After which a topic has ceased [s]: some five of its messages, as the twin sends them. How often real
robots send all but the first is to be confirmed on hardware."""

TYPES = {
    JOINT_STATES: "sensor_msgs/JointState",
    ENDPOINT_STATE: "intera_core_msgs/EndpointState",
    COLLISION_STATE: "intera_core_msgs/CollisionDetectionState",
    ROBOT_STATE: "intera_core_msgs/RobotAssemblyState",
    GRIPPER_STATE: "intera_core_msgs/IODeviceStatus",
    GRIPPER_CONFIGURATION: "intera_core_msgs/IODeviceConfiguration",
    END_EFFECTOR_CONFIGURATION: "intera_core_msgs/IONodeConfiguration",
    JOINT_COMMAND: "intera_core_msgs/JointCommand",
    SPEED_RATIO: "std_msgs/Float64",
    COMMAND_TIMEOUT: "std_msgs/Float64",
    ENABLE: "std_msgs/Bool",
    STOP: "std_msgs/Empty",
    RESET: "std_msgs/Empty",
    GRIPPER_COMMAND: "intera_core_msgs/IOComponentCommand",
}
