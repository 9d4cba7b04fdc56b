"""The Sawyer with its Rethink gripper, and where the two of them stand."""

import json
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from taskschema.arrays import FloatArray, IntArray
from taskschema.kinematics.arm import ArmKinematics
from taskschema.kinematics.rotation import vertical_turn

BASE_DISTANCE = 0.56
"""From the table's centre to each robot's base [m]: robosuite's distance for its 0.8 m table."""
BASE_HEIGHT = 0.112
"""Of a robot's base above the table's top [m]: robosuite's mount beside its 0.8 m high table."""
NEUTRAL = (0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161)
"""The vendor's neutral joint angles [rad]."""
GRIPPER_STROKE = 0.041667
"""Travel of the real electric gripper's two fingers together [m]: less than that of robosuite's model."""


@dataclass(frozen=True)
class Gripper:
    """Two fingers that close along the end effector's x axis."""

    closed: float
    """Opening between the pads with the fingers fully closed [m]."""
    open: float
    """Opening between the pads with the fingers fully open [m]."""
    fingertip: float
    """How far the finger tips reach beyond the end effector's origin [m]."""


@cache
def sawyer() -> ArmKinematics:
    """Return the Sawyer's kinematics with its base at the world's origin."""
    description = _description()
    joints, tool = description["joints"], description["tool"]

    def column(name: str) -> FloatArray:
        return np.array([joint[name] for joint in joints])

    limits = column("range")
    return ArmKinematics(
        base_position=np.zeros(3),
        base_rotation=np.eye(3),
        positions=column("position"),
        rotations=column("rotation"),
        tool_position=np.array(tool["position"]),
        tool_rotation=np.array(tool["rotation"]),
        lower=limits[:, 0],
        upper=limits[:, 1],
        velocity=column("velocity"),
        acceleration=column("acceleration"),
    )


@cache
def sawyer_pair() -> tuple[ArmKinematics, ArmKinematics]:
    """Return the left arm, at negative y facing positive y, and the right one opposite."""
    quarter_turns = vertical_turn(np.array([np.pi / 2, -np.pi / 2])).round(15)
    left, right = (
        sawyer().at(np.array([0.0, side * BASE_DISTANCE, BASE_HEIGHT]), rotation)
        for side, rotation in zip((-1.0, 1.0), quarter_turns, strict=True)
    )
    return left, right


def sawyers(sides: IntArray) -> ArmKinematics:
    """Return the arms of a batch: [N] 0 for the left one, 1 for the right one."""
    bases, rotations = _bases()
    return sawyer().at(bases[sides], rotations[sides])


@cache
def _bases() -> tuple[FloatArray, FloatArray]:
    """Return both arms' bases in the world frame: positions [2, 3] in metres and rotations [2, 3, 3]."""
    pair = sawyer_pair()
    return np.stack([arm.base_position for arm in pair]), np.stack([arm.base_rotation for arm in pair])


@cache
def rethink_gripper() -> Gripper:
    """Return the gripper's geometry."""
    gripper = _description()["gripper"]
    return Gripper(closed=gripper["closed"], open=gripper["open"], fingertip=gripper["fingertip"])


@cache
def _description() -> dict:  # type: ignore[type-arg]
    return json.loads((resources.files("taskschema") / "data" / "sawyer.json").read_text())  # type: ignore[no-any-return]
