"""The scene for pictures is the scene for physics with other looks."""

from importlib import resources

import mujoco
import numpy as np
import pytest

from taskschema.tasks.registry import get_task, task_names
from taskschema.tasks.scene_task import SceneTask
from taskschema_worker.rendering.visual_scene import visual_model
from taskschema_worker.scenes import scene_model

SCENES = [name for name in task_names() if isinstance(get_task(name), SceneTask)]
SHOWN_GROUPS = 3
"""MuJoCo shows geom groups 0 to 2 unless told otherwise."""
FACES = 40_000


@pytest.fixture(scope="module", params=SCENES)
def models(request):
    task = get_task(request.param)
    return scene_model(task), visual_model(task)


def test_a_state_means_the_same_in_both_models(models):
    lean, visual = models
    joints = [
        [(model.joint(index).name, model.jnt_qposadr[index]) for index in range(model.njnt)]
        for model in models
    ]
    assert joints[0] == joints[1]
    assert lean.nq == visual.nq
    generator = np.random.default_rng(1)
    positions = np.array(lean.qpos0) + generator.normal(scale=0.3, size=lean.nq)
    places = []
    for model in models:
        data = mujoco.MjData(model)
        data.qpos[:] = positions
        mujoco.mj_kinematics(model, data)
        sites = [data.site(f"{arm}_grip").xpos.copy() for arm in ("left", "right")]
        places.append(np.concatenate([*sites, data.body("object").xpos, data.body("object").xquat]))
    np.testing.assert_allclose(places[0], places[1], atol=1e-12)


def test_the_model_for_physics_has_no_meshes_and_arms_show_nothing_else(models):
    lean, visual = models
    assert lean.nmesh == 0
    for index in range(visual.ngeom):
        body = visual.body(visual.geom_bodyid[index]).name
        if body.startswith(("left_", "right_")) and visual.geom_group[index] < SHOWN_GROUPS:
            assert visual.geom_type[index] == mujoco.mjtGeom.mjGEOM_MESH, visual.geom(index).name
    assert visual.geom("table").group[0] >= SHOWN_GROUPS


def test_looks_touch_and_weigh_nothing(models):
    lean, visual = models
    meshes = visual.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    assert meshes.any()
    assert not visual.geom_contype[meshes].any()
    assert not visual.geom_conaffinity[meshes].any()
    assert visual.body_mass.sum() == pytest.approx(lean.body_mass.sum(), abs=1e-9)


def test_meshes_are_few_and_small(models):
    _, visual = models
    shown = visual.geom_dataid[visual.geom_type == mujoco.mjtGeom.mjGEOM_MESH]
    assert 5_000 < visual.mesh_facenum[shown].sum() < FACES
    assert (resources.files("taskschema") / "data" / "sawyer_visual.xml").read_bytes().__len__() < 2_000_000
