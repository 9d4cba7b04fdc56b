"""The nine objects: every one complete, of the paper's families, and simulable."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from taskschema.errors import ConfigError, UnknownNameError
from taskschema_robot.objects.catalogue import OBJECTS, get_object
from taskschema_robot.objects.marker import TABLE_MARKERS, Marker, table_markers
from taskschema_robot.objects.robot_object import RobotObject

PAGE = Path(__file__).parents[2] / "docs/run-a-robot.md"
FAMILIES = {"lateral_lifting": 4, "picking": 1, "opening": 2, "rotating": 2}
"""Objects of each family in the paper's real experiments (Table I)."""


def test_there_are_the_papers_nine():
    assert len(OBJECTS) == 9
    for family, count in FAMILIES.items():
        assert sum(item.family == family for item in OBJECTS.values()) == count


def test_no_marker_is_used_twice():
    numbers = [marker.number for item in OBJECTS.values() for marker in (*item.markers, *item.joint_markers)]
    assert len(numbers) == len(set(numbers))
    assert not set(numbers) & set(TABLE_MARKERS)


@pytest.mark.parametrize("item", OBJECTS.values(), ids=OBJECTS)
def test_the_twin_simulates_it(item: RobotObject):
    model = mujoco.MjModel.from_xml_string(item.mjcf)
    assert model.nq == 7 + bool(item.joint_parts)
    assert 0.3 * item.mass < model.body_subtreemass[1] < 3.0 * item.mass
    data = mujoco.MjData(model)
    lowest, highest = np.full(3, np.inf), np.full(3, -np.inf)
    for angle in np.linspace(0.0, np.pi, 19) if item.joint_parts else (0.0,):
        data.qpos[7:] = angle
        mujoco.mj_forward(model, data)
        for geom in range(model.ngeom):
            frame = data.geom_xmat[geom].reshape(3, 3)
            centre = data.geom_xpos[geom] + frame @ model.geom_aabb[geom, :3]
            half = np.abs(frame) @ model.geom_aabb[geom, 3:]
            lowest, highest = np.minimum(lowest, centre - half), np.maximum(highest, centre + half)
    np.testing.assert_allclose(highest - lowest, item.size, atol=0.025)  # whatever way it is turned
    assert lowest[2] == pytest.approx(-0.5 * item.size[2], abs=0.003)


@pytest.mark.parametrize("item", OBJECTS.values(), ids=OBJECTS)
def test_a_person_is_told_how_to_reset_it(item: RobotObject):
    assert item.reset
    assert all(step.endswith(".") for step in item.reset)
    hinged = item.family in ("opening", "rotating")
    assert bool(item.joint_markers) == hinged


def test_corners_of_a_marker():
    marker = Marker(0, 0.2, (1.0, 2.0, 3.0))
    np.testing.assert_allclose(
        marker.corners, [[0.9, 2.1, 3.0], [1.1, 2.1, 3.0], [1.1, 1.9, 3.0], [0.9, 1.9, 3.0]]
    )


def test_bad_configuration_is_refused():
    with pytest.raises(ConfigError, match="right angles"):
        Marker(0, 0.1, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    with pytest.raises(ConfigError, match="same number"):
        RobotObject("x", "picking", (1, 1, 1), 1.0, (Marker(0, 0.1, (0, 0, 0)),) * 2, ("Do.",), ())
    with pytest.raises(UnknownNameError, match="rolling-pin"):
        get_object("roling-pin")
    assert len(table_markers()) == 6


def documented(item: RobotObject) -> str:
    """Return an object's row in the table of docs/run-a-robot.md."""
    size = " x ".join(f"{1000 * edge:.0f}" for edge in item.size)
    numbers = ", ".join(f"{marker.number} ({1000 * marker.size:.0f})" for marker in item.markers)
    turning = ", ".join(f"{marker.number} ({1000 * marker.size:.0f})" for marker in item.joint_markers)
    markers = f"{numbers}; turning {turning}" if turning else numbers
    return f"| `{item.name}` | {size} | {item.mass:g} | {markers} | {' '.join(item.reset)} |"


@pytest.mark.parametrize("item", OBJECTS.values(), ids=OBJECTS)
def test_the_table_in_the_docs_is_the_catalogues(item: RobotObject):
    assert documented(item) in PAGE.read_text().splitlines(), f"the row should be\n{documented(item)}"
