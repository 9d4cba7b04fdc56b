"""Who may import whom: the arrows of the architecture, and what each part needs to be installed."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = {
    "taskschema": ROOT / "shared/taskschema",
    "taskschema_worker": ROOT / "services/worker/taskschema_worker",
    "taskschema_learner": ROOT / "services/learner/taskschema_learner",
    "taskschema_robot": ROOT / "services/robot_agent/taskschema_robot",
}
HEAVY = {"torch", "ray", "mujoco", "robosuite", "gymnasium", "fastapi", "matplotlib", "cv2", "tensorboard"}


def imported_packages(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module.split(".")[0])
    return names & set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_arrows_point_one_way(package):
    allowed = {package, "taskschema"}
    if package == "taskschema_learner":  # the command composes learner and workers
        allowed.add("taskschema_worker")
    for path in PACKAGES[package].rglob("*.py"):
        assert imported_packages(path) <= allowed, f"{path} imports {imported_packages(path) - allowed}"


def modules_of(package: str, *, below: str = "", without: tuple[str, ...] | None = None) -> list[str]:
    root = PACKAGES[package]
    names = []
    for path in sorted((root / below).rglob("*.py")):
        parts = path.relative_to(root.parent).with_suffix("").parts
        outside = without is not None and parts[: len(without)] == without
        if parts[-1] not in ("__main__", "generate_data") and not outside:
            names.append(".".join(parts[:-1] if parts[-1] == "__init__" else parts))
    return names


def import_without(modules: list[str], forbidden: set[str]) -> subprocess.CompletedProcess[str]:
    """Import modules in a new interpreter in which the forbidden ones look as if not installed."""
    script = (
        "import sys, importlib\n"
        f"for name in {sorted(forbidden)!r}: sys.modules[name] = None\n"
        f"for name in {modules!r}: importlib.import_module(name)\n"
    )
    return subprocess.run([sys.executable, "-W", "error", "-c", script], capture_output=True, text=True)


@pytest.mark.parametrize(
    ("modules", "needed"),
    [
        (modules_of("taskschema", without=("taskschema", "safety")), set()),
        (modules_of("taskschema", below="safety"), {"mujoco"}),
        (["taskschema_worker", "taskschema_worker.worker", "taskschema_worker.rollout"], set()),
        (modules_of("taskschema_worker"), {"mujoco", "gymnasium"}),
        (modules_of("taskschema_learner", below="api"), {"fastapi"}),
        (modules_of("taskschema_robot"), {"mujoco", "cv2"}),
        (["taskschema_learner.cli.main"], set()),
    ],
    ids=[
        "shared",
        "checks before a motion",
        "worker on a task without physics",
        "worker",
        "api",
        "robot",
        "command line",
    ],
)
def test_parts_need_only_their_own_extra(modules, needed):
    result = import_without(modules, HEAVY - needed)
    assert result.returncode == 0, result.stderr
    assert result.stdout == ""
    assert result.stderr == ""  # no foreign warnings either


def test_a_forbidden_import_would_be_seen():
    result = import_without(["gymnasium"], {"gymnasium"})
    assert result.returncode != 0


def test_nothing_that_crosses_a_process_is_unpickled():
    for root in PACKAGES.values():
        for path in root.rglob("*.py"):
            text = path.read_text()
            for word in (r"(import|from) pickle\b", "cloudpickle", r"torch\.load\b", r"yaml\.load\("):
                assert re.search(word, text) is None, f"{path} contains {word}"
