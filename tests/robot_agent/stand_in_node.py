"""The ROS node that stood in for a Sawyer when the recordings were made: its topics, types and answers."""

import asyncio
import math
from collections.abc import Callable

from taskschema_robot.twin.ros.graph import RosGraph, Service, ServiceError
from taskschema_robot.twin.ros.message import Message, default_message
from taskschema_robot.twin.ros.serialisation import ros_time

IK_SERVICE = "/ExternalTools/right/PositionKinematicsNode/IKService"
JOINTS = [f"right_j{joint}" for joint in range(7)]
NEUTRAL = [0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161]
COMMANDS = {
    "/robot/limb/right/joint_command": "intera_core_msgs/JointCommand",
    "/robot/limb/right/set_speed_ratio": "std_msgs/Float64",
    "/robot/set_super_enable": "std_msgs/Bool",
    "/robot/set_super_stop": "std_msgs/Empty",
    "/robot/set_super_reset": "std_msgs/Empty",
    "/io/end_effector/right_gripper/command": "intera_core_msgs/IOComponentCommand",
    "/test/ctl": "std_msgs/String",
    "/test/in/uint8": "std_msgs/UInt8",
    "/test/in/int32": "std_msgs/Int32",
    "/test/in/int64": "std_msgs/Int64",
    "/test/in/float32": "std_msgs/Float32",
    "/test/in/float64": "std_msgs/Float64",
    "/test/in/time": "std_msgs/Time",
    "/test/in/duration": "std_msgs/Duration",
    "/test/in/header": "std_msgs/Header",
    "/test/in/string": "std_msgs/String",
    "/test/in/bool": "std_msgs/Bool",
    "/test/in/uint8s": "std_msgs/UInt8MultiArray",
    "/test/in/mixed": "std_msgs/Float64MultiArray",
    "/test/in/image": "sensor_msgs/Image",
    "/test/in/camera_info": "sensor_msgs/CameraInfo",
}
VALUES = {
    "float32": ("std_msgs/Float32", 0.10000000149011612),
    "float64": ("std_msgs/Float64", 0.1),
    "float64_whole": ("std_msgs/Float64", 1.0),
    "float64_small": ("std_msgs/Float64", 1e-7),
    "float64_large": ("std_msgs/Float64", 1.7e308),
    "nan": ("std_msgs/Float64", math.nan),
    "inf32": ("std_msgs/Float32", math.inf),
    "mixed": ("std_msgs/Float64MultiArray", [1.5, math.nan, math.inf, -math.inf, -0.0]),
    "uint8s": ("std_msgs/UInt8MultiArray", bytes(range(10))),
    "bytes": ("std_msgs/ByteMultiArray", [1, -2, 3]),
    "chars": ("std_msgs/Char", 65),
    "time": ("std_msgs/Time", {"secs": 1700000000, "nsecs": 123456789}),
    "duration": ("std_msgs/Duration", {"secs": -1, "nsecs": 500000000}),
    "int64": ("std_msgs/Int64", 2**53 + 1),
    "uint64": ("std_msgs/UInt64", 2**64 - 1),
    "string": ("std_msgs/String", 'café ☃ "q" \\ / \n \x01'),
    "bool": ("std_msgs/Bool", True),
    "big": ("std_msgs/String", ("0123456789" * 30)),
}
PERIOD = 0.01


class StandInNode:
    """Publishes, answers, and records all that it receives as (topic, fields)."""

    def __init__(self, graph: RosGraph, now: Callable[[], float]) -> None:
        self.graph = graph
        self.now = now
        self.received: list[tuple[str, Message]] = []
        self.tick_count = 0
        self._gripper_commands: list[Message] = []
        self._due: list[tuple[float, Message]] = []
        for topic, type_name in COMMANDS.items():
            graph.subscribe(topic, type_name, lambda message, topic=topic: self._receive(topic, message))
        self._publish_values()
        for topic, kind in (
            ("/test/tick", "std_msgs/UInt32"),
            ("/robot/joint_states", "sensor_msgs/JointState"),
            ("/robot/limb/right/endpoint_state", "intera_core_msgs/EndpointState"),
            ("/io/end_effector/right_gripper/state", "intera_core_msgs/IODeviceStatus"),
        ):
            graph.advertise(topic, kind)
        self._state = default_message("intera_core_msgs/RobotAssemblyState") | {"homed": True}
        graph.advertise("/robot/state", "intera_core_msgs/RobotAssemblyState", latch=True)
        self._publish_state(ready=True, enabled=True)
        self._publish_gripper_configuration()
        types = [f"intera_core_msgs/SolvePositionIK{part}" for part in ("Request", "Response")]
        graph.serve(IK_SERVICE, Service(*types, self._solve))

    def _publish_values(self) -> None:
        for name, (type_name, value) in VALUES.items():
            topic = f"/test/out/{name}"
            self.graph.advertise(topic, type_name, latch=True)
            self.graph.publish(topic, default_message(type_name) | {"data": value})
        self.graph.advertise("/test/out/empty", "std_msgs/Empty", latch=True)
        self.graph.publish("/test/out/empty", {})
        image = default_message("sensor_msgs/Image")
        image["header"]["frame_id"] = "cam"
        image |= {"height": 2, "width": 2, "encoding": "mono8", "step": 2, "data": bytes((0, 127, 128, 255))}
        info = default_message("sensor_msgs/CameraInfo")
        info |= {"height": 2, "width": 2, "K": [1.0, 0.0, 2.0, 0.0, 1.0, 2.0, 0.0, 0.0, 1.0]}
        for name, type_name, message in (
            ("image", "sensor_msgs/Image", image),
            ("camera_info", "sensor_msgs/CameraInfo", info),
        ):
            self.graph.advertise(f"/test/out/{name}", type_name, latch=True)
            self.graph.publish(f"/test/out/{name}", message)

    def tick(self) -> None:
        """Publish what is due: call at 100 Hz."""
        self.tick_count += 1
        self.graph.publish("/test/tick", {"data": self.tick_count})
        header = {"seq": 0, "stamp": ros_time(self.now()), "frame_id": ""}
        names = ["head_pan", *JOINTS, "torso_t0"]
        zeros = [0.0] * len(names)
        state = {"name": names, "position": [0.0, *NEUTRAL, 0.0], "velocity": zeros, "effort": zeros}
        self.graph.publish("/robot/joint_states", {"header": header} | state)
        endpoint = default_message("intera_core_msgs/EndpointState")
        self.graph.publish("/robot/limb/right/endpoint_state", endpoint)
        due = [time for moment, time in self._due if moment <= self.now()]
        self._due = [entry for entry in self._due if entry[0] > self.now()]
        self._gripper_commands += due
        if due or self.tick_count % 50 == 0:
            self._publish_gripper_state()

    def _publish_gripper_state(self) -> None:
        state = default_message("intera_core_msgs/IODeviceStatus")
        ready = {"tag": "ready", "id": "", "detail": "{}"}
        state |= {"time": ros_time(self.now()), "device": {"name": "right_gripper", "status": ready}}
        state["commands"] = list(self._gripper_commands[-5:])
        state["signals"] = [
            {"name": name, "format": '{"role":"output","type":"x"}', "data": data, "status": ready}
            for name, data in (("position_response_m", "[ 0.0 ]"), ("is_calibrated", "[ true ]"))
        ]
        self.graph.publish("/io/end_effector/right_gripper/state", state)

    def _publish_state(self, **changes: object) -> None:
        self._state = self._state | changes
        self.graph.publish("/robot/state", dict(self._state))

    def _publish_gripper_configuration(self) -> None:
        node = default_message("intera_core_msgs/IONodeConfiguration") | {"time": ros_time(self.now())}
        node["node"] = {"name": "end_effector", "config": "{}"}
        properties = '{"props": {"device": "electric_gripper"}}'
        node["devices"] = [{"name": "right_gripper", "config": properties}]
        self.graph.advertise("/io/end_effector/config", "intera_core_msgs/IONodeConfiguration", latch=True)
        self.graph.publish("/io/end_effector/config", node)
        device = default_message("intera_core_msgs/IODeviceConfiguration") | {"time": ros_time(self.now())}
        device |= {"commanded": "{}", "upgraded": "{}"}
        device["device"] = {"name": "right_gripper", "config": '{"params": {}}'}
        device["signals"] = [
            {"name": name, "config": f'{{"role": "{role}", "type": "{kind}"}}'}
            for name, role, kind in (
                ("position_m", "input", "float"),
                ("position_response_m", "output", "float"),
                ("is_calibrated", "output", "bool"),
            )
        ]
        topic = "/io/end_effector/right_gripper/config"
        self.graph.advertise(topic, "intera_core_msgs/IODeviceConfiguration", latch=True)
        self.graph.publish(topic, device)

    def _receive(self, topic: str, message: Message) -> None:
        self.received.append((topic, message))
        if topic == "/test/ctl":
            self._control(message["data"].split())
        elif topic == "/io/end_effector/right_gripper/command":
            known = [*self._gripper_commands, *(time for _, time in self._due)]
            if message["time"] not in known:
                self._due.append((self.now() + 0.25, message["time"]))
        elif topic.startswith("/robot/set_super"):
            self._switch(topic.rpartition("_")[2], message)

    def _switch(self, action: str, message: Message) -> None:
        stopped = self._state["stopped"]
        if action == "stop":
            self._publish_state(ready=False, enabled=False, stopped=True, estop_source=2)
        elif action == "reset" and stopped:
            self._publish_state(ready=False, enabled=False, stopped=False, estop_source=0)
        elif action == "enable" and not stopped:
            self._publish_state(ready=message["data"], enabled=message["data"])

    def _control(self, words: list[str]) -> None:
        self.received.pop()
        if words[0] == "listen":
            topic, kind = words[1], f"std_msgs/{words[2]}"
            self.graph.subscribe(topic, kind, lambda message: self.received.append((topic, message)))

    async def _solve(self, request: Message) -> Message:
        shown = {name: request[name] for name in ("pose_stamp", "tip_names", "seed_mode")}
        self.received.append((IK_SERVICE, shown))
        mode = request["seed_mode"]
        if mode == 77:
            raise ServiceError("error processing request: solver exploded")
        if mode == 78:
            raise ServiceError("service cannot process request: service handler returned None")
        if mode == 79:
            await asyncio.sleep(1.5)
        response = default_message("intera_core_msgs/SolvePositionIKResponse")
        for pose in request["pose_stamp"]:
            joints = default_message("sensor_msgs/JointState")
            result = 1
            if request["tip_names"] and request["tip_names"][0] == "left_hand":
                result = -3
            elif pose["pose"]["position"]["x"] > 2.0:
                result = -1
            if result > 0:
                joints |= {"name": JOINTS, "position": [math.nan if mode == 80 else 0.1] * 7}
            response["joints"].append(joints)
            response["result_type"].append(result)
        return response
