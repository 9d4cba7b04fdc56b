"""Write what each image installs: the part of requirements.lock that its own extra needs.

`python deploy/docker/image_locks.py` reads the installed environment, as `make lock` does for the whole lock;
a test compares the two.
"""

import importlib.metadata
import tomllib
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]
EXTRAS = ("worker", "api", "learner", "robot")
"""Each is one image; `embedded` is the learner's with the worker's added."""
INSTALLED_FIRST = {"torch"}
"""Installed alone, before the rest, so that a CPU wheel is taken where there is one."""


def pinned(extra: str) -> list[str]:
    """Return `name==version` of everything that an extra of this project needs, sorted by name.

    Raises:
        importlib.metadata.PackageNotFoundError: if some of it is not installed here.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found: dict[str, str] = {}
    waiting = [Requirement(line) for line in (*project["dependencies"], *_extra(project, extra))]
    seen: set[str] = set()
    while waiting:
        requirement = waiting.pop()
        if str(requirement) in seen:
            continue
        seen.add(str(requirement))
        distribution = importlib.metadata.distribution(requirement.name)
        found[canonicalize_name(requirement.name)] = (
            f"{distribution.metadata['Name']}=={distribution.version.partition('+')[0]}"
        )
        waiting += [item for item in _requirements(distribution) if _applies(item, requirement.extras)]
    return [line for name, line in sorted(found.items()) if name not in INSTALLED_FIRST]


def text(extra: str) -> str:
    """Return the content of an extra's file."""
    return f"# Written by `make lock`: what the extra {extra!r} needs.\n" + "\n".join(pinned(extra)) + "\n"


def path(extra: str) -> Path:
    """Return where an extra's file lies."""
    return FOLDER / f"requirements-{extra}.lock"


def _extra(project: dict[str, Any], name: str) -> list[str]:
    """Return an extra's requirements; one that names another extra of this project stands for its own."""
    lines = []
    for line in project["optional-dependencies"][name]:
        requirement = Requirement(line)
        if canonicalize_name(requirement.name) == project["name"]:
            lines += [inner for extra in requirement.extras for inner in _extra(project, extra)]
        else:
            lines.append(line)
    return lines


def _requirements(distribution: importlib.metadata.Distribution) -> list[Requirement]:
    return [Requirement(line) for line in distribution.requires or ()]


def _applies(requirement: Requirement, extras: set[str]) -> bool:
    marker = requirement.marker
    return marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras))


if __name__ == "__main__":
    for name in EXTRAS:
        path(name).write_text(text(name), encoding="utf-8")
        print(f"{path(name).relative_to(ROOT)}: {len(pinned(name))} packages")
