"""What is installed: no version with a hole that concerns this project, and the check for new ones."""

import importlib.util
import json
import re
from pathlib import Path

import pytest
from packaging.version import Version

ROOT = Path(__file__).parents[1]
LEAST = {"ray": "2.52", "torch": "2.10"}
"""Ray: token authentication (CVE-2023-48022, CVE-2025-62593). torch: CVE-2025-32434, CVE-2026-24747."""


def pins() -> dict[str, str]:
    lock = (ROOT / "requirements.lock").read_text()
    first = re.findall(r"install .*?(torch==\S+)", (ROOT / "Makefile").read_text())
    lines = [line for line in [*lock.splitlines(), *first] if "==" in line]
    return dict(line.split("==", 1) for line in lines)


@pytest.mark.parametrize(("name", "least"), LEAST.items())
def test_pins_are_new_enough(name: str, least: str) -> None:
    assert Version(pins()[name]) >= Version(least)


def audit():
    spec = importlib.util.spec_from_file_location("audit", ROOT / ".ci/audit.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_audit_reads_the_same_torch() -> None:
    assert f"torch=={pins()['torch']}" == audit().FIRST


NOBODY = "pip-audit: the advisories cannot be reached from here; dependencies were not checked"
GOOD = {"name": "redis", "version": "8.1.0", "vulns": []}
BAD = {
    "name": "jinja2",
    "version": "2.4.1",
    "vulns": [{"id": "PYSEC-2014-8", "aliases": ["CVE-2014-1402"], "fix_versions": ["2.7.2"]}],
}
SKIPPED = {"name": "absl-py", "skip_reason": "Dependency not found on PyPI"}


@pytest.mark.parametrize(
    ("packages", "status", "line"),
    [
        ([GOOD, BAD], 1, "jinja2 2.4.1: PYSEC-2014-8 CVE-2014-1402, fixed in 2.7.2"),
        ([GOOD], 0, "pip-audit: no known vulnerability in 1 pinned packages"),
        ([GOOD, SKIPPED], 0, "pip-audit: no known vulnerability in 1 pinned packages, 1 not on PyPI"),
        (
            [SKIPPED],
            0,
            "pip-audit: the advisories cannot be reached from here; dependencies were not checked",
        ),
        (None, 0, NOBODY),
    ],
)
def test_the_audit_fails_for_what_it_finds_alone(packages, status: int, line: str) -> None:
    text = "" if packages is None else json.dumps({"dependencies": packages, "fixes": []})
    found, lines = audit().verdict(text)
    assert (found, lines[0]) == (status, line)
