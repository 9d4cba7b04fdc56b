"""Per-instance objects: a rewritten model equals one compiled at that size and density."""

import copy

import mujoco
import numpy as np
import pytest

from taskschema.tasks.scene_task import ObjectInstance
from taskschema_worker.object_model import ObjectModel

FIELDS = (
    "body_mass",
    "body_inertia",
    "body_ipos",
    "body_pos",
    "body_subtreemass",
    "body_invweight0",
    "dof_invweight0",
    "geom_pos",
    "geom_size",
    "geom_rbound",
    "geom_aabb",
    "bvh_aabb",
)


def compiled(scale=1.0, density=1000.0):
    """A box with two knobs and a hinged lid off its centre, beside a post that does not change."""
    xml = f"""
    <mujoco>
      <worldbody>
        <geom name="table" type="plane" size="1 1 0.1"/>
        <body name="post" pos="0.5 0 0"><joint axis="0 0 1"/><geom type="box" size="0.02 0.03 0.1"/></body>
        <body name="object">
          <freejoint name="object"/>
          <geom type="box" size="{0.02 * scale} {0.03 * scale} {0.05 * scale}" density="{density}"/>
          <geom type="sphere" pos="{0.03 * scale} 0 0" size="{0.01 * scale}" density="{density}"/>
          <geom type="capsule" pos="0 0 {0.06 * scale}" size="{0.01 * scale} {0.02 * scale}"
            density="{density}"/>
          <body name="lid" pos="{0.01 * scale} 0 {0.08 * scale}">
            <joint name="hinge" axis="0 0 1"/>
            <geom type="cylinder" pos="0 {0.004 * scale} 0" size="{0.02 * scale} {0.01 * scale}"
              density="{density}"/>
          </body>
        </body>
      </worldbody>
    </mujoco>
    """
    return mujoco.MjModel.from_xml_string(xml)


@pytest.mark.parametrize(("scale", "density"), [(1.0, 1000.0), (0.85, 400.0), (1.3, 2500.0)])
def test_rewritten_model_equals_a_compiled_one(scale, density):
    template = compiled()
    model = copy.copy(template)
    writer = ObjectModel(template)
    # What an earlier episode left in the copy must not matter.
    writer.write(model, ObjectInstance((0, 0, 0), (1, 0, 0, 0), density=7.0, scale=2.0))
    writer.write(model, ObjectInstance((0, 0, 0), (1, 0, 0, 0), density=density, scale=scale))
    expected = compiled(scale, density)
    for field in FIELDS:
        np.testing.assert_allclose(
            getattr(model, field), getattr(expected, field), rtol=1e-6, atol=1e-12, err_msg=field
        )


def test_the_template_itself_is_never_changed():
    template, untouched = compiled(), compiled()
    ObjectModel(template).write(copy.copy(template), ObjectInstance((0, 0, 0), (1, 0, 0, 0), 300.0, 1.2))
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(template, field), getattr(untouched, field), err_msg=field)


def test_pose_ends_with_the_object_s_joints():
    instance = ObjectInstance((0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0), 1000.0, joints=(0.5,))
    np.testing.assert_array_equal(instance.pose, [0.1, 0.2, 0.3, 1, 0, 0, 0, 0.5])
