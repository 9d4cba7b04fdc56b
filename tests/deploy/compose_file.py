"""The compose file as data, with the example's settings filled in."""

import re
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]


def settings() -> dict[str, str]:
    """Return a new .env, with secrets."""
    done = subprocess.run([ROOT / "deploy/docker/new-env.sh"], capture_output=True, text=True, check=True)
    lines = [line for line in done.stdout.splitlines() if line and not line.startswith("#")]
    return dict(line.split("=", 1) for line in lines)


def services() -> dict[str, dict[str, Any]]:
    """Return the services, `${NAME}` left as it stands in the file."""
    found: dict[str, dict[str, Any]] = raw()["services"]
    return found


@cache
def raw() -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))
    return loaded


def variables(text: str) -> set[str]:
    """Return the settings that a text refers to."""
    return set(re.findall(r"(?<!\$)\$\{([A-Z_]+)", text))
