"""The scene: two Sawyers at opposing ends of a table and the task's object, composed as one MJCF model.

It is text here, and needs no simulator: workers compile it for speed, a robot's twin with what a camera sees.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from importlib import resources

from taskschema.errors import TaskFileError
from taskschema.kinematics.rotation import matrix_to_quaternion
from taskschema.kinematics.sawyer import sawyer_pair
from taskschema.skills.pairs import ARMS
from taskschema.tasks.scene_task import SceneTask

TIMESTEP = 0.008
"""Physics step [s]."""
PAD_FRICTION = 0.1
"""Of pads, links and table: below every object's, whose own then counts (MuJoCo takes the larger)."""

TABLE, OBJECT, LEFT, RIGHT = 1, 2, 4, 8
"""Collision groups as bits: what may touch what."""
MASKS: dict[str, tuple[int, int]] = {
    "table": (TABLE, 0),
    "object": (OBJECT, TABLE),
    "left": (LEFT, TABLE | OBJECT | RIGHT),
    "right": (RIGHT, TABLE | OBJECT),
}
"""Contact type and affinity of each group. An arm never touches itself: its skills keep far from that."""
FREE_JOINTS = ("freejoint[@name='object']", "joint[@name='object'][@type='free']")
"""Where the object's free joint stands in its body."""
NAMES = ("name", "joint", "class")
"""Attributes of an arm's elements that hold names."""


def scene_mjcf(task: SceneTask) -> ET.Element:
    """Return the task's scene as MJCF; see `compose_scene`.

    Raises:
        TaskFileError: if its `object_mjcf` is no XML, or has not the body and the joints that it must have.
    """
    _require_object(task)
    return compose_scene(task.name, task.object_mjcf)


def _require_object(task: SceneTask) -> None:
    """Refuse an object of which it would not be known where it is.

    Raises:
        TaskFileError: that says what is needed.
    """
    try:
        model = ET.fromstring(task.object_mjcf.strip())
    except ET.ParseError as error:
        raise TaskFileError(f"object_mjcf of task {task.name!r} is no XML: {error}.") from None
    if model.find("worldbody/body[@name='object']") is None:
        raise TaskFileError(
            f"object_mjcf of task {task.name!r} has no body called object in its worldbody: it needs "
            '<body name="object"><freejoint name="object"/>...</body>.'
        )
    if not any(model.find(f"worldbody/body[@name='object']/{joint}") is not None for joint in FREE_JOINTS):
        raise TaskFileError(
            f"object_mjcf of task {task.name!r} has no free joint called object: its body needs "
            '<freejoint name="object"/>.'
        )
    elements = [element for world in model.findall("worldbody") for element in world.iter()]
    joints = [element.get("name") for element in elements if element.tag in ("joint", "freejoint")]
    if joints != ["object", *task.object_joints]:
        raise TaskFileError(
            f"The joints in object_mjcf of task {task.name!r} must be the free joint object and then its "
            f"object_joints ({_words(task.object_joints)}), in this order, but are: {_words(joints)}."
        )


def _words(names: Iterable[str | None]) -> str:
    return ", ".join(name or "one without a name" for name in names) or "none"


def compose_scene(name: str, object_mjcf: str) -> ET.Element:
    """Return a scene as MJCF; joints come in the order left arm, right arm, object.

    Args:
        name: of the model.
        object_mjcf: see `SceneTask.object_mjcf`.

    """
    root = ET.Element("mujoco", {"model": name})
    compiler = {"angle": "radian", "autolimits": "true", "discardvisual": "true", "fusestatic": "true"}
    root.append(ET.Element("compiler", compiler))
    option = {"timestep": f"{TIMESTEP:g}", "integrator": "implicitfast", "cone": "pyramidal"}
    own_model = ET.fromstring(object_mjcf.strip())
    for element in own_model.findall("option"):
        option |= element.attrib
    root.append(ET.Element("option", option))
    sections = {tag: ET.SubElement(root, tag) for tag in ("default", "asset", "worldbody", "actuator")}
    table = {"name": "table", "type": "plane", "size": "1 1 0.1"}
    sections["worldbody"].append(ET.Element("geom", table | _contact("table")))
    arm_text = (resources.files("taskschema") / "data" / "sawyer.xml").read_text()
    for arm, kinematics in zip(ARMS, sawyer_pair(), strict=True):
        model = ET.fromstring(arm_text)
        base = next(model.iter("body"))
        base.set("pos", _numbers(kinematics.base_position))
        base.set("quat", _numbers(matrix_to_quaternion(kinematics.base_rotation)))
        for element in model.iter():
            element.attrib |= {key: f"{arm}_{element.get(key)}" for key in NAMES if element.get(key)}
        for geom in base.iter("geom"):
            geom.attrib |= _contact(arm)
        _merge(sections, model)
    for geom in own_model.iter("geom"):
        contype, conaffinity = MASKS["object"]
        geom.attrib |= {"contype": str(contype), "conaffinity": str(conaffinity)}
    _merge(sections, own_model)
    return root


def _contact(group: str) -> dict[str, str]:
    contype, conaffinity = MASKS[group]
    friction = f"{PAD_FRICTION:g} 0.005 0.0001"
    return {"contype": str(contype), "conaffinity": str(conaffinity), "friction": friction}


def _merge(sections: dict[str, ET.Element], model: ET.Element) -> None:
    for tag, section in sections.items():
        for part in model.findall(tag):
            section.extend(part)


def _numbers(values: object) -> str:
    return " ".join(repr(float(value)) for value in values)  # type: ignore[attr-defined]
