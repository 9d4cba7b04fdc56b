"""Generate the Sawyer's data from robosuite: `python -m taskschema_worker.generate_data`.

Writes into `shared/taskschema/data`: `sawyer.json` (kinematics and limits, for planning without a simulator),
`sawyer.xml` (one arm with its gripper in MJCF: primitive collision shapes, position servos),
`sawyer_visual.xml` (its looks: decimated meshes) and robosuite's licence notice. This is the only module of
the packages that imports robosuite; with `visual_data` it needs the extra `dev`.
"""

import argparse
import contextlib
import importlib.metadata
import io
import json
import logging
import xml.etree.ElementTree as ET
from importlib import resources
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from taskschema_worker.arm_description import (
    ACCELERATION_LIMITS,
    CAPSULES,
    FINGER_CAPSULES,
    JOINT_SERVOS,
    VELOCITY_LIMITS,
    Capsule,
)
from taskschema_worker.visual_data import visual_mjcf

ARM_JOINTS = tuple(f"right_j{index}" for index in range(7))
FINGER_JOINTS = ("l_finger_joint", "r_finger_joint")
GRAVITY_COMPENSATED = (*(f"right_l{link}" for link in range(1, 7)), "right_hand", "gripper_base")
"""Bodies whose weight the servos carry. Every one costs time, so it is left out where it does nothing: for
the light fingers, and for what stands on or turns about the vertical first axis."""
SMALLEST_MASS = 1e-3
"""Bodies lighter than this [kg] that carry no joint are frames for cameras and the like: left out."""


def robosuite_assets() -> Path:
    """Return the folder of robosuite's model files, importing it without its warnings."""
    logging.getLogger("robosuite_logs").setLevel(logging.CRITICAL)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        import robosuite
    return Path(robosuite.__file__).parent / "models" / "assets"


def _mass(body: ET.Element) -> float:
    inertial = body.find("inertial")
    return float(inertial.get("mass", "0")) if inertial is not None else 0.0


def _carries_weight(body: ET.Element) -> bool:
    return (
        body.find("joint") is not None
        or _mass(body) > SMALLEST_MASS
        or any(_carries_weight(child) for child in body.findall("body"))
    )


def _capsule(name: str, capsule: Capsule, group: str) -> ET.Element:
    start, end, radius = capsule
    points = " ".join(f"{value:g}" for value in (*start, *end))
    shape = {"type": "capsule", "fromto": points, "size": f"{radius:g}", "class": group}
    return ET.Element("geom", {"name": name} | shape)


def _clean_body(source: ET.Element) -> ET.Element:
    """Copy a body with its inertia, joints and heavy children; shapes are replaced by a few capsules."""
    name = source.get("name", "")
    keep = {key: source.get(key, "") for key in ("name", "pos", "quat") if source.get(key)}
    body = ET.Element("body", keep | ({"gravcomp": "1"} if name in GRAVITY_COMPENSATED else {}))
    for tag in ("inertial", "joint"):
        for element in source.findall(tag):
            if tag == "inertial" and _mass(source) <= SMALLEST_MASS:
                continue
            body.append(ET.Element(tag, dict(element.attrib)))
    for index, capsule in enumerate(CAPSULES.get(name, ())):
        body.append(_capsule(f"{name}_{index}", capsule, "arm"))
    if name in FINGER_CAPSULES:
        body.append(_capsule(f"{name}_pad", FINGER_CAPSULES[name], "finger"))
    for child in source.findall("body"):
        if name == "gripper_base" and child.get("name") == "eef":
            site = {key: child.get(key, "") for key in ("pos", "quat")}
            body.append(ET.Element("site", {"name": "grip", "size": "0.005"} | site))
        elif _carries_weight(child) or child.get("name") == "right_hand":
            body.append(_clean_body(child))
    return body


def _find_body(root: ET.Element, name: str) -> ET.Element:
    return next(body for body in root.iter("body") if body.get("name") == name)


def arm_mjcf(assets: Path) -> ET.Element:
    """Return one Sawyer with its Rethink gripper, base at the origin."""
    robot = ET.parse(assets / "robots/sawyer/robot.xml").getroot()
    gripper = ET.parse(assets / "grippers/rethink_gripper.xml").getroot()
    base = _clean_body(_find_body(robot, "base"))
    _find_body(base, "right_hand").append(_clean_body(_find_body(gripper, "gripper_base")))
    for joint in base.iter("joint"):
        name = joint.get("name", "")
        if name in ARM_JOINTS:
            servo = JOINT_SERVOS[ARM_JOINTS.index(name)]
            joint.attrib |= {
                "armature": f"{servo.armature:g}",
                "damping": f"{servo.damping:g}",
                "actuatorgravcomp": "true",
                "actuatorfrcrange": f"{-servo.effort:g} {servo.effort:g}",
            }
    root = ET.Element("mujoco", {"model": "sawyer"})
    root.append(ET.Element("compiler", {"angle": "radian", "autolimits": "true"}))
    root.append(_defaults())
    world = ET.SubElement(root, "worldbody")
    world.append(base)
    root.append(_actuators(gripper))
    ET.indent(root)
    return root


def _defaults() -> ET.Element:
    default = ET.Element("default")
    for name in ("arm", "finger"):
        group = ET.SubElement(default, "default", {"class": name})
        group.append(ET.Element("geom", {"type": "capsule", "mass": "0", "group": "3"}))
    return default


def _actuators(gripper: ET.Element) -> ET.Element:
    actuators = ET.Element("actuator")
    for name, servo in zip(ARM_JOINTS, JOINT_SERVOS, strict=True):
        actuators.append(
            ET.Element(
                "general",
                {
                    "name": name,
                    "joint": name,
                    "gainprm": f"{servo.stiffness:g}",
                    "biastype": "affine",
                    "biasprm": f"0 {-servo.stiffness:g} {-servo.velocity_gain:g}",
                },
            )
        )
    for source in gripper.iter("position"):
        # The command reaches past the joint's range: only the force limit sets how hard a finger presses.
        keep = {key: source.get(key, "") for key in ("joint", "kp", "forcerange")}
        actuators.append(ET.Element("position", keep | {"name": keep["joint"], "ctrlrange": "-0.1 0.1"}))
    return actuators


def arm_json(root: ET.Element) -> dict[str, Any]:
    """Return kinematics and limits read from the compiled arm at zero configuration."""
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    position, rotation = np.zeros(3), np.eye(3)
    joints = []
    for index, name in enumerate(ARM_JOINTS):
        body = model.jnt_bodyid[model.joint(name).id]
        body_rotation = data.xmat[body].reshape(3, 3)
        joints.append(
            {
                "name": name,
                "position": _rounded(rotation.T @ (data.xpos[body] - position)),
                "rotation": _rounded(rotation.T @ body_rotation),
                "range": _rounded(model.jnt_range[model.joint(name).id]),
                "velocity": VELOCITY_LIMITS[index],
                "acceleration": ACCELERATION_LIMITS[index],
                "effort": JOINT_SERVOS[index].effort,
            }
        )
        position, rotation = data.xpos[body].copy(), body_rotation.copy()
    grip = data.site("grip")
    tool = {
        "position": _rounded(rotation.T @ (grip.xpos - position)),
        "rotation": _rounded(rotation.T @ grip.xmat.reshape(3, 3)),
    }
    return {"joints": joints, "tool": tool, "gripper": _gripper(model, data)}


def _gripper(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, Any]:
    """Return the opening between the pads at both ends of the fingers' travel [m], and finger geometry."""
    pads = [model.geom(f"{finger}_pad") for finger in FINGER_CAPSULES]
    openings = []
    for left, right in ((-0.0115, 0.0115), (0.020833, -0.020833)):
        data.qpos[[model.joint(name).qposadr[0] for name in FINGER_JOINTS]] = left, right
        mujoco.mj_kinematics(model, data)
        centres = [data.geom_xpos[pad.id] for pad in pads]
        openings.append(float(np.linalg.norm(centres[0] - centres[1]) - 2 * pads[0].size[0]))
    grip = data.site("grip")
    local = [grip.xmat.reshape(3, 3).T @ (data.geom_xpos[pad.id] - grip.xpos) for pad in pads]
    reach = local[0][2] + pads[0].size[1] + pads[0].size[0]
    closing = (local[0] - local[1]) / np.linalg.norm(local[0] - local[1])
    return {
        "closed": round(openings[0], 6),
        "open": round(openings[1], 6),
        "closing_axis": _rounded(closing),
        "fingertip": round(float(reach), 6),
    }


def _rounded(values: ArrayLike) -> list[Any]:
    rounded: list[Any] = (np.round(np.asarray(values, dtype=np.float64), 9) + 0.0).tolist()
    return rounded


def licence() -> str:
    """Return robosuite's licence text, as its distribution carries it."""
    distribution = importlib.metadata.distribution("robosuite")
    for path in distribution.files or ():
        if path.name.upper().startswith("LICENSE") and ".dist-info" in str(path):
            return str(path.read_text())
    raise FileNotFoundError("robosuite's distribution carries no licence file")


def generate(folder: Path) -> list[Path]:
    """Write the data files into `folder` and return their paths."""
    assets = robosuite_assets()
    root = arm_mjcf(assets)
    visual = visual_mjcf(assets, {body.get("name", "") for body in root.iter("body")})
    version = importlib.metadata.version("robosuite")
    description = {"source": f"robosuite {version}, MIT licence: see LICENSE.robosuite"} | arm_json(root)
    contents = {
        "sawyer.xml": ET.tostring(root, encoding="unicode") + "\n",
        "sawyer_visual.xml": ET.tostring(visual, encoding="unicode") + "\n",
        "sawyer.json": json.dumps(description, indent=1) + "\n",
        "LICENSE.robosuite": licence(),
    }
    for name, text in contents.items():
        (folder / name).write_text(text)
    return [folder / name for name in contents]


def main() -> None:
    """Write the files, by default into the installed package's data folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path(str(resources.files("taskschema"))) / "data")
    for path in generate(parser.parse_args().folder):
        print(path)


if __name__ == "__main__":
    main()
