"""The twin's scene: the one that the policy was trained in, with what a camera sees and a fault needs."""

import xml.etree.ElementTree as ET

import cv2
import mujoco
import numpy as np

from taskschema.kinematics.rotation import matrix_to_quaternion
from taskschema.scene import TABLE, compose_scene
from taskschema.visual_scene import dress_scene
from taskschema_robot.camera.camera import Intrinsics
from taskschema_robot.objects.marker import DICTIONARY, Marker, table_markers
from taskschema_robot.objects.robot_object import RobotObject
from taskschema_robot.twin.world import OBSTACLE, TIMESTEP

CAMERA = "agent"
CAMERA_HEIGHT = 1.4
"""Above the middle of the table, looking straight down; the picture's right is x, its top y [m]."""
VIEW = 1.1
"""Width and height of the table that the picture shows [m]."""
PICTURE = 1080
"""Width and height of the picture [pixels]."""
MARKER_CELLS = 6
"""Along the black square's edge; a white cell surrounds it."""
CELL_PIXELS = 16
PLATE_THICKNESS = 0.0005
"""[m]"""
OBSTACLE_SHAPE = (0.045, 0.25)
"""Radius and half height of the bar that stands for a person's arm [m]."""
LOOKS = {"table_top": {"size": "0.55 0.4 0.02"}}
"""What differs from the simulation's room: a table with room for its markers beside the robots' reach."""


def physics_model(robot_object: RobotObject) -> mujoco.MjModel:
    """Compile the twin's world: both arms, the object, and what a fault puts in the way."""
    return mujoco.MjModel.from_xml_string(ET.tostring(_physics(robot_object), encoding="unicode"))


def picture_model(robot_object: RobotObject) -> mujoco.MjModel:
    """Compile the same world, with the same `qpos`, as the camera sees it, printed markers included."""
    root = _physics(robot_object)
    dress_scene(root)
    world, asset, visual = (next(root.iter(tag)) for tag in ("worldbody", "asset", "visual"))
    visual.append(ET.Element("quality", {"shadowsize": "0", "offsamples": "0"}))
    for name, attributes in LOOKS.items():
        next(geom for geom in world.iter("geom") if geom.get("name") == name).attrib |= attributes
    world.append(_camera())
    bodies = {body.get("name", ""): body for body in root.iter("body")} | {"world": world}
    placed = {"world": table_markers(), "object": robot_object.markers, "turning": robot_object.joint_markers}
    assets: dict[str, bytes] = {}
    for body, markers in placed.items():
        for marker in markers:
            label = f"marker_{marker.number}"
            assets[f"{label}.png"] = marker_picture(marker.number)
            asset.append(ET.Element("texture", {"name": label, "type": "2d", "file": f"{label}.png"}))
            asset.append(ET.Element("material", {"name": label, "texture": label, "specular": "0"}))
            bodies[body].append(_plate(label, marker))
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"), assets)


def _physics(robot_object: RobotObject) -> ET.Element:
    root = compose_scene(robot_object.name, robot_object.mjcf)
    compiler, option = (next(root.iter(tag)) for tag in ("compiler", "option"))
    # Hands are told from forearms by their bodies.
    compiler.set("fusestatic", "false")
    option.set("timestep", f"{TIMESTEP:g}")
    obstacle = ET.SubElement(next(root.iter("worldbody")), "body", {"name": OBSTACLE, "mocap": "true"})
    radius, half = OBSTACLE_SHAPE
    shape = {"type": "capsule", "size": f"{radius:g} {half:g}", "rgba": "0.85 0.6 0.45 1"}
    obstacle.append(ET.Element("geom", shape | {"contype": str(TABLE), "conaffinity": "0"}))
    return root


def marker_picture(number: int) -> bytes:
    """Return a marker as a PNG, its white border included."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    square = cv2.aruco.generateImageMarker(dictionary, number, MARKER_CELLS * CELL_PIXELS)
    bordered = np.pad(square, CELL_PIXELS, constant_values=255)
    return bytes(cv2.imencode(".png", cv2.cvtColor(bordered, cv2.COLOR_GRAY2BGR))[1])


def intrinsics(size: int = PICTURE) -> Intrinsics:
    """Return the camera's projection for pictures of `size` x `size`: a pinhole without distortion."""
    focal = size * CAMERA_HEIGHT / VIEW
    centre = 0.5 * size
    matrix = np.array([[focal, 0.0, centre], [0.0, focal, centre], [0.0, 0.0, 1.0]])
    return Intrinsics(matrix, np.zeros(5))


def _plate(label: str, marker: Marker) -> ET.Element:
    x, y = np.asarray(marker.x_axis), np.asarray(marker.y_axis)
    quaternion = matrix_to_quaternion(np.stack([x, y, np.cross(x, y)], axis=1))
    half = 0.5 * marker.size * (MARKER_CELLS + 2) / MARKER_CELLS
    attributes = {
        "name": label,
        "type": "box",
        "size": f"{half:g} {half:g} {0.5 * PLATE_THICKNESS:g}",
        "pos": " ".join(f"{value:g}" for value in marker.position),
        "quat": " ".join(f"{value:.9g}" for value in quaternion),
        "material": label,
        "mass": "0",
        "contype": "0",
        "conaffinity": "0",
        "group": "1",
    }
    return ET.Element("geom", attributes)


def _camera() -> ET.Element:
    angle = np.degrees(2.0 * np.arctan(0.5 * VIEW / CAMERA_HEIGHT))
    return ET.Element("camera", {"name": CAMERA, "pos": f"0 0 {CAMERA_HEIGHT:g}", "fovy": f"{angle:.9g}"})
