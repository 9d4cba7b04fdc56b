"""Look for known vulnerabilities in what requirements.lock pins, where the network reaches the advisories.

Exit status 1 only for what was found: without the network nothing is known, which one line says.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
FIRST = "torch==2.13.0"
"""Installed before the lock (see the Makefile)."""
ACCEPTED: dict[str, str] = {}
"""Advisories that do not concern this project, each with the reason."""
SECONDS = 120


def main() -> int:
    """Run pip-audit and return the exit status."""
    status, lines = verdict(answer())
    print("\n".join(lines), file=sys.stderr if status else sys.stdout)
    return status


def answer() -> str:
    """Return what pip-audit finds about the pinned packages, as JSON; empty if it could ask nobody."""
    with tempfile.TemporaryDirectory() as folder:
        pins = Path(folder, "requirements.txt")
        pins.write_text(f"{(ROOT / 'requirements.lock').read_text()}{FIRST}\n")
        words = ["--requirement", str(pins), "--no-deps", "--disable-pip", "--format", "json"]
        command = [sys.executable, "-m", "pip_audit", *words, "--progress-spinner", "off", "--timeout", "10"]
        try:
            return subprocess.run(command, capture_output=True, text=True, timeout=SECONDS).stdout
        except subprocess.TimeoutExpired:
            return ""


def verdict(text: str) -> tuple[int, list[str]]:
    """Return the exit status and what to print for an answer of pip-audit."""
    try:
        packages: list[dict[str, Any]] = json.loads(text)["dependencies"]
    except (json.JSONDecodeError, KeyError):
        packages = []
    checked = [package for package in packages if "skip_reason" not in package]
    if not checked:
        return 0, ["pip-audit: the advisories cannot be reached from here; dependencies were not checked"]
    lines = []
    for package in checked:
        for found in package["vulns"]:
            names = [found["id"], *found.get("aliases", ())]
            if not set(names) & set(ACCEPTED):
                fixed = ", ".join(found["fix_versions"]) or "no version yet"
                lines.append(f"{package['name']} {package['version']}: {' '.join(names)}, fixed in {fixed}")
    if lines:
        return 1, [*lines, "Update these in pyproject.toml and requirements.lock (`make lock`)."]
    unknown = f", {len(packages) - len(checked)} not on PyPI" if len(checked) < len(packages) else ""
    return 0, [f"pip-audit: no known vulnerability in {len(checked)} pinned packages{unknown}"]


if __name__ == "__main__":
    sys.exit(main())
