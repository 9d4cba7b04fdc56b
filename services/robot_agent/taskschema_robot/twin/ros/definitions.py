"""Fields of the ROS message types that the twin knows.

Sources: ros/std_msgs, ros/common_msgs; RethinkRobotics/intera_common, commit a298fec.
"""

POSE = "geometry_msgs/Pose"

DEFINITIONS: dict[str, str] = {
    "std_msgs/Empty": "",
    "std_msgs/Bool": "bool data",
    "std_msgs/UInt8": "uint8 data",
    "std_msgs/Int32": "int32 data",
    "std_msgs/UInt32": "uint32 data",
    "std_msgs/Int64": "int64 data",
    "std_msgs/UInt64": "uint64 data",
    "std_msgs/Float32": "float32 data",
    "std_msgs/Float64": "float64 data",
    "std_msgs/Char": "uint8 data",
    "std_msgs/String": "string data",
    "std_msgs/Time": "time data",
    "std_msgs/Duration": "duration data",
    "std_msgs/Header": "uint32 seq; time stamp; string frame_id",
    "std_msgs/MultiArrayDimension": "string label; uint32 size; uint32 stride",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim; uint32 data_offset",
    "std_msgs/UInt8MultiArray": "std_msgs/MultiArrayLayout layout; uint8[] data",
    "std_msgs/ByteMultiArray": "std_msgs/MultiArrayLayout layout; int8[] data",
    "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout; float64[] data",
    "geometry_msgs/Point": "float64 x; float64 y; float64 z",
    "geometry_msgs/Vector3": "float64 x; float64 y; float64 z",
    "geometry_msgs/Quaternion": "float64 x; float64 y; float64 z; float64 w",
    POSE: "geometry_msgs/Point position; geometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseStamped": f"std_msgs/Header header; {POSE} pose",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear; geometry_msgs/Vector3 angular",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force; geometry_msgs/Vector3 torque",
    "sensor_msgs/JointState": (
        "std_msgs/Header header; string[] name; float64[] position; float64[] velocity; float64[] effort"
    ),
    "sensor_msgs/Image": (
        "std_msgs/Header header; uint32 height; uint32 width; string encoding; uint8 is_bigendian;"
        " uint32 step; uint8[] data"
    ),
    "sensor_msgs/RegionOfInterest": (
        "uint32 x_offset; uint32 y_offset; uint32 height; uint32 width; bool do_rectify"
    ),
    "sensor_msgs/CameraInfo": (
        "std_msgs/Header header; uint32 height; uint32 width; string distortion_model; float64[] D;"
        " float64[9] K; float64[9] R; float64[12] P; uint32 binning_x; uint32 binning_y;"
        " sensor_msgs/RegionOfInterest roi"
    ),
    "intera_core_msgs/JointCommand": (
        "std_msgs/Header header; int32 mode; string[] names; float64[] position; float64[] velocity;"
        " float64[] acceleration; float64[] effort"
    ),
    "intera_core_msgs/EndpointState": (
        f"std_msgs/Header header; {POSE} pose; geometry_msgs/Twist twist; geometry_msgs/Wrench wrench;"
        " bool valid"
    ),
    "intera_core_msgs/CollisionDetectionState": "std_msgs/Header header; bool collision_state",
    "intera_core_msgs/RobotAssemblyState": (
        "bool homed; bool ready; bool enabled; bool stopped; bool error; bool lowVoltage;"
        " uint8 estop_button; uint8 estop_source"
    ),
    "intera_core_msgs/IOStatus": "string tag; string id; string detail",
    "intera_core_msgs/IODataStatus": (
        "string name; string format; string data; intera_core_msgs/IOStatus status"
    ),
    "intera_core_msgs/IOComponentStatus": "string name; intera_core_msgs/IOStatus status",
    "intera_core_msgs/IOComponentConfiguration": "string name; string config",
    "intera_core_msgs/IOComponentCommand": "time time; string op; string args",
    "intera_core_msgs/IONodeConfiguration": (
        "time time; intera_core_msgs/IOComponentConfiguration node;"
        " intera_core_msgs/IOComponentConfiguration[] devices;"
        " intera_core_msgs/IOComponentConfiguration[] plugins"
    ),
    "intera_core_msgs/IODeviceConfiguration": (
        "time time; string commanded; string upgraded; intera_core_msgs/IOComponentConfiguration device;"
        " intera_core_msgs/IOComponentConfiguration[] ports;"
        " intera_core_msgs/IOComponentConfiguration[] signals"
    ),
    "intera_core_msgs/IODeviceStatus": (
        "time time; intera_core_msgs/IOComponentStatus device; intera_core_msgs/IODataStatus[] ports;"
        " intera_core_msgs/IODataStatus[] signals; time[] commands; string[] responses"
    ),
    "intera_core_msgs/SolvePositionIKRequest": (
        "geometry_msgs/PoseStamped[] pose_stamp; sensor_msgs/JointState[] seed_angles; int8 seed_mode;"
        " bool[] use_nullspace_goal; sensor_msgs/JointState[] nullspace_goal; float64[] nullspace_gain;"
        " string[] tip_names"
    ),
    "intera_core_msgs/SolvePositionIKResponse": "sensor_msgs/JointState[] joints; int8[] result_type",
    "intera_core_msgs/SolvePositionFKRequest": ("sensor_msgs/JointState[] configuration; string[] tip_names"),
    "intera_core_msgs/SolvePositionFKResponse": (
        "geometry_msgs/PoseStamped[] pose_stamp; bool[] isValid; bool[] inCollision"
    ),
}
"""Fields of each type in order; `type[]` is an array, `type[9]` one of fixed length."""
