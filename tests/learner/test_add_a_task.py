"""docs/add-a-task.md: its task with physics, in a file of a user's own, is solved, trained and verified."""

import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from taskschema.errors import TaskFileError
from taskschema.tasks.lateral_lifting import LateralLifting
from taskschema.tasks.registry import get_task, load_task_source, read_task_file
from taskschema_worker.audit.episodes import expert, run_schema
from taskschema_worker.scene_environment import SceneEnvironment

ROOT = Path(__file__).parents[2]
REFERENCE = "docs/examples/tray.py:Tray"
COMMAND = Path(sys.executable).with_name("taskschema")


@pytest.fixture(scope="module")
def tray():
    return load_task_source(*read_task_file(str(ROOT / REFERENCE)))


def success(task, schema, instances):
    with closing(SceneEnvironment(task)) as environment:
        return run_schema(environment, task, schema, instances, expert(task)).success.mean()


def test_the_example_is_solved_by_two_arms_and_not_by_one(tray):
    generator = np.random.default_rng(0)
    instances = [tray.draw_instance(generator) for _ in range(20)]
    corners = [tray.draw_corner(corner, generator) for corner in range(len(tray.corner_names))]
    assert success(tray, tray.paper_schema, instances + corners) >= 0.95
    left_alone = tuple((left, "no_op") for left, _ in tray.paper_schema)
    assert success(tray, left_alone, instances) == 0


def test_from_images_both_handles_are_within_reach_wherever_the_tray_lies(tray):
    generator = np.random.default_rng(0)
    corners = [tray.draw_corner(corner, generator).position for corner in range(len(tray.corner_names))]
    # Handles 0.085 m from the middle, which is up to 0.05 m from the table's: 0.135 m of 0.05 + 0.1 m.
    assert 0.13 < max(abs(y) for _, y, _ in corners) + 0.085 <= tray.table.y[1]


@pytest.mark.parametrize("name", ["HeavyBar", "RollingPin", "Box"])
def test_the_bars_schema_lifts_other_objects_too_and_one_arm_does_not(name):
    carried = load_task_source(*read_task_file(str(ROOT / f"docs/examples/carried.py:{name}")))
    generator = np.random.default_rng(0)
    instances = [carried.draw_instance(generator) for _ in range(8)]
    corners = [carried.draw_corner(corner, generator) for corner in range(len(carried.corner_names))]
    assert carried.paper_schema == LateralLifting.paper_schema
    assert success(carried, carried.paper_schema, instances + corners) >= 0.95
    left_alone = tuple((left, "no_op") for left, _ in carried.paper_schema)
    assert success(carried, left_alone, instances) == 0


def test_the_goal_is_what_its_distance_says(tray):
    start = tray.draw_instance(np.random.default_rng(1)).pose[None]
    poses = np.repeat(start[:, None], 3, axis=1)
    poses[0, :, 2] += [0.1, 0.16, 0.16]
    poses[0, 2, 3:7] = [np.cos(0.2), np.sin(0.2), 0.0, 0.0]  # tilted by 0.4 rad
    # 0.1 of 0.15 m are risen: a third is missing; the tilt is 0.4 / 0.25 - 1 = 0.6 limits too large.
    np.testing.assert_allclose(tray.goal_distance(start, poses), [[1 / 3, 0.0, 0.6]], atol=1e-9)
    assert tray.goal_reached(start, poses).tolist() == [[False, True, False]]


def test_it_trains_and_verifies_from_its_file(tmp_path):
    (tmp_path / "tray.py").write_text((ROOT / "docs/examples/tray.py").read_text())
    run = ["--run-dir", "run", "--workers", "0", "--api", "none", "--slots", "4", "--rounds", "2"]
    for arguments in (["train", "--task-file", "tray.py:Tray", *run], ["verify", "run"]):
        result = subprocess.run(
            [COMMAND, *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=250
        )
        assert result.returncode == 0, result.stderr
    assert "The same: 2 rounds" in result.stdout


BASE = """
from taskschema.skills.lift import Lift
from taskschema.skills.no_op import NoOp
from taskschema.skills.pairs import PairSpace
from taskschema.skills.registry import get_skill
from taskschema.tasks.lateral_lifting import LateralLifting

class Own(LateralLifting):
    name = "own"
"""


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (
            "pairs = PairSpace([get_skill('lift'), get_skill('twist')])",
            "'twist', which is for opening, but its own family 'lateral_lifting' allows: "
            "lift, no_op, top_grasp",
        ),
        ("family = 'stacking'", "family 'stacking' allows: no_op"),
        ("pairs = None", "pairs must be a PairSpace"),
    ],
)
def test_a_skill_that_the_family_does_not_allow_is_refused(lines, reason):
    with pytest.raises(TaskFileError, match=reason) as refusal:
        load_task_source("Own", f"{BASE}    {lines}\n")
    assert "\n" not in str(refusal.value)


def test_a_family_of_one_s_own_has_skills_that_name_it():
    source = BASE.replace("class Own", "class Hoist(Lift):\n    families = ('stacking',)\n\nclass Own")
    source += "    family = 'stacking'\n    pairs = PairSpace([Hoist(), NoOp()])\n"
    assert [skill.name for skill in load_task_source("Own", source).pairs.skills] == ["lift", "no_op"]


def test_a_registered_task_is_held_to_its_family_too(monkeypatch):
    monkeypatch.setattr(LateralLifting, "family", "opening")
    with pytest.raises(TaskFileError, match="'lift', which is for"):
        get_task("lateral-lifting")


def test_the_page_names_what_stands_in_the_file():
    page = (ROOT / "docs" / "add-a-task.md").read_text()
    assert f"taskschema train --task-file {REFERENCE}" in page
    assert f"taskschema replay --task-file {REFERENCE}" in page
