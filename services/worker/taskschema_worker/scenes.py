"""The task's scene, compiled."""

import xml.etree.ElementTree as ET

import mujoco

from taskschema.errors import TaskFileError
from taskschema.scene import scene_mjcf
from taskschema.tasks.scene_task import SceneTask


def scene_model(task: SceneTask) -> mujoco.MjModel:
    """Compile the task's scene for physics: no visual shapes, static bodies fused.

    Raises:
        TaskFileError: if its `object_mjcf` cannot be compiled.
    """
    text = ET.tostring(scene_mjcf(task), encoding="unicode")
    try:
        return mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise TaskFileError(f"object_mjcf of task {task.name!r} does not compile: {error}") from None
