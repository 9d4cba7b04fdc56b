"""No motion bypasses the gate: only the gate, drivers and composition roots ever see a driver."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "services/robot_agent/taskschema_robot"
HOLDERS = {"safety/gate.py", "safety/readiness.py"}
"""The only modules outside the drivers and the twin that may call them."""
PLACES = ("drivers/", "twin/", "cli/")
"""Drivers themselves, what they talk to, and where they are made and handed to the gate."""
DATA = {"ArmState", "GripperState"}
"""What everybody may import from the drivers' interface."""


def modules() -> list[Path]:
    return [path for path in sorted(PACKAGE.rglob("*.py")) if not _relative(path).startswith(PLACES)]


def _relative(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def imported_from_drivers(tree: ast.AST) -> set[str]:
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("taskschema_robot.drivers"):
            names |= {alias.name for alias in node.names}
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names if alias.name.startswith("taskschema_robot.drivers")}
    return names


@pytest.mark.parametrize("path", modules(), ids=_relative)
def test_only_the_gate_imports_a_driver(path):
    names = imported_from_drivers(ast.parse(path.read_text()))
    assert _relative(path) in HOLDERS or names <= DATA, names - DATA


def test_only_the_gate_names_a_drivers_commands():
    for path in modules():
        if _relative(path) in HOLDERS:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and node.attr in {"command", "set_gripper", "set_speed_ratio"}:
                raise AssertionError(f"{_relative(path)}, line {node.lineno}, names {node.attr}")


def test_the_interface_of_the_gate_shows_no_driver():
    tree = ast.parse((PACKAGE / "safety/gated_arms.py").read_text())
    methods = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    assert methods == {"fault", "states", "check", "execute", "stop"}


def test_an_import_would_be_seen():
    assert imported_from_drivers(ast.parse("from taskschema_robot.drivers.driver import ArmDriver"))
