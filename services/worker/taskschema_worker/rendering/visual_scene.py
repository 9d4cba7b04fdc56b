"""The task's scene for pictures, compiled."""

import xml.etree.ElementTree as ET

import mujoco

from taskschema.tasks.scene_task import SceneTask
from taskschema.visual_scene import visual_mjcf


def visual_model(task: SceneTask) -> mujoco.MjModel:
    """Compile the task's scene for pictures; its `qpos` is that of the model for physics."""
    return mujoco.MjModel.from_xml_string(ET.tostring(visual_mjcf(task), encoding="unicode"))
