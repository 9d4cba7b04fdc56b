"""The task's scene, compiled."""

import xml.etree.ElementTree as ET

import mujoco

from taskschema.scene import scene_mjcf
from taskschema.tasks.scene_task import SceneTask


def scene_model(task: SceneTask) -> mujoco.MjModel:
    """Compile the task's scene for physics: no visual shapes, static bodies fused."""
    return mujoco.MjModel.from_xml_string(ET.tostring(scene_mjcf(task), encoding="unicode"))
