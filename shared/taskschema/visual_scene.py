"""The scene as a person sees it: the same bodies and joints as for physics, with meshes, table and floor.

It is text here, and needs no simulator: workers draw it, and so does a robot's twin.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from importlib import resources

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import sawyer_pair
from taskschema.scene import scene_mjcf
from taskschema.skills.pairs import ARMS
from taskschema.tasks.scene_task import SceneTask

TABLE_EDGE = 0.8
"""Edge length of the square table [m]: robosuite's."""
TABLE_THICKNESS = 0.04
LEG = (0.03, 0.36)
"""Half width of a table's leg, and its distance from the table's centre lines [m]."""
FLOOR = -0.8
"""Height of the floor in the world frame [m]: robosuite's table is 0.8 m high."""
HIDDEN_GROUP = "3"
"""Geom group that no camera shows."""
OVERHEAD_HEIGHT = 1.25
"""Of the overhead camera above the table [m]."""
OVERHEAD_VIEW = 0.8
"""Edge length of the square of table top that the overhead camera sees [m]."""

MATERIALS = {
    "table": {"rgba": "0.86 0.78 0.66 1", "specular": "0.1", "shininess": "0.1"},
    "pedestal": {"rgba": "0.22 0.22 0.24 1", "specular": "0.2"},
    "table_leg": {"rgba": "0.35 0.36 0.38 1"},
    "floor": {"texture": "floor", "texrepeat": "4 4", "texuniform": "true", "specular": "0.05"},
}
FLOOR_TEXTURE = {
    "name": "floor",
    "type": "2d",
    "builtin": "checker",
    "rgb1": "0.60 0.63 0.67",
    "rgb2": "0.64 0.67 0.71",
    "width": "128",
    "height": "128",
}
SKY = {
    "type": "skybox",
    "builtin": "gradient",
    "rgb1": "0.93 0.95 0.97",
    "rgb2": "0.72 0.77 0.83",
    "width": "64",
    "height": "64",
}
LIGHTS = (
    {"pos": "1.2 -0.8 2.4", "dir": "-0.45 0.3 -0.9", "diffuse": "0.5 0.5 0.5", "castshadow": "true"},
    {"pos": "-1.0 1.0 2.4", "dir": "0.4 -0.4 -0.9", "diffuse": "0.15 0.15 0.16", "castshadow": "false"},
)
HEADLIGHT = {"ambient": "0.36 0.36 0.36", "diffuse": "0.12 0.12 0.12", "specular": "0 0 0"}


def visual_mjcf(task: SceneTask) -> ET.Element:
    """Return the task's scene for pictures as MJCF."""
    root = scene_mjcf(task)
    dress_scene(root)
    return root


def dress_scene(root: ET.Element) -> None:
    """Give a scene, as `compose_scene` returns it, what makes a picture: meshes, a room, light, cameras."""
    _only(root, "compiler").set("discardvisual", "false")
    asset, world = _only(root, "asset"), _only(root, "worldbody")
    next(geom for geom in world.iter("geom") if geom.get("name") == "table").set("group", HIDDEN_GROUP)
    asset.append(ET.Element("texture", FLOOR_TEXTURE))
    asset.append(ET.Element("texture", SKY))
    asset.extend(ET.Element("material", {"name": name} | looks) for name, looks in MATERIALS.items())
    world.extend(_room())
    world.extend(
        ET.Element("light", {"directional": "true", "specular": "0.2 0.2 0.2"} | light) for light in LIGHTS
    )
    world.extend(_cameras())
    _add_arms(asset, world)
    root.append(ET.Element("statistic", {"center": "0 0 0.3", "extent": "1"}))
    visual = ET.SubElement(root, "visual")
    visual.append(ET.Element("headlight", HEADLIGHT))
    visual.append(ET.Element("global", {"offwidth": "1920", "offheight": "1440"}))
    visual.append(ET.Element("map", {"znear": "0.05", "zfar": "12", "shadowclip": "1.1"}))


def _only(root: ET.Element, tag: str) -> ET.Element:
    element = root.find(tag)
    assert element is not None, f"scene_mjcf writes a {tag} element"
    return element


def _add_arms(asset: ET.Element, world: ET.Element) -> None:
    """Put the meshes on the bodies of both arms, which share them."""
    text = (resources.files("taskschema") / "data" / "sawyer_visual.xml").read_text()
    looks = ET.fromstring(text)
    asset.extend(_only(looks, "asset"))
    bodies = {body.get("name"): body for body in world.iter("body")}
    for arm in ARMS:
        for carrier in _only(looks, "worldbody"):
            body = bodies[f"{arm}_{carrier.get('name')}"]
            body.extend(ET.Element(geom.tag, dict(geom.attrib)) for geom in carrier)


def _room() -> Iterable[ET.Element]:
    """Return table, floor and pedestals, which nothing touches: physics has a plane of its own."""
    half = 0.5 * TABLE_EDGE
    yield _box("table_top", "table", (0, 0, -0.5 * TABLE_THICKNESS), (half, half, 0.5 * TABLE_THICKNESS))
    width, distance = LEG
    bottom = FLOOR + TABLE_THICKNESS
    for x in (-distance, distance):
        for y in (-distance, distance):
            place = (x, y, 0.5 * bottom - TABLE_THICKNESS)
            yield _box(None, "table_leg", place, (width, width, -0.5 * bottom))
    for arm in sawyer_pair():
        yield from _pedestal(arm.base_position)
    floor = {"name": "floor", "type": "plane", "size": "6 6 0.1", "pos": f"0 0 {FLOOR:g}"}
    yield ET.Element("geom", floor | {"material": "floor"} | UNTOUCHED)


def _pedestal(base: FloatArray) -> Iterable[ET.Element]:
    """Return what a robot stands on: a column from the floor to its base [3], and a foot."""
    top = float(base[2])
    for radius, bottom, height in (
        (0.075, FLOOR, top - FLOOR),
        (0.24, FLOOR, 0.04),
        (0.13, top - 0.02, 0.02),
    ):
        place = (float(base[0]), float(base[1]), bottom + 0.5 * height)
        sizes = {"pos": _numbers(place), "size": _numbers((radius, 0.5 * height))}
        yield ET.Element("geom", {"type": "cylinder", "material": "pedestal"} | sizes | UNTOUCHED)


UNTOUCHED = {"contype": "0", "conaffinity": "0", "group": "1"}


def _box(name: str | None, material: str, place: Iterable[float], half: Iterable[float]) -> ET.Element:
    named = {} if name is None else {"name": name}
    sizes = {"pos": _numbers(place), "size": _numbers(half)}
    return ET.Element("geom", named | {"type": "box", "material": material} | sizes | UNTOUCHED)


def _cameras() -> Iterable[ET.Element]:
    """Return the cameras: `overhead` straight down, x to the right, y up; others from the side."""
    fovy = math.degrees(2 * math.atan2(0.5 * OVERHEAD_VIEW, OVERHEAD_HEIGHT))
    places = {
        "overhead": {"pos": f"0 0 {OVERHEAD_HEIGHT:g}", "xyaxes": "1 0 0 0 1 0", "fovy": f"{fovy:.6g}"},
        "front": {"pos": "2.1 0 1.05", "xyaxes": "0 1 0 -0.312 0 0.95", "fovy": "33"},
        "close": {"pos": "1.2 0 0.58", "xyaxes": "0 1 0 -0.358 0 0.934", "fovy": "36"},
    }
    for name, place in places.items():
        yield ET.Element("camera", {"name": name} | place)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:g}" for value in values)
