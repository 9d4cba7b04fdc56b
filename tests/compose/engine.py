"""Finding a Docker engine that can build and run the project's images."""

import re
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]

ANSWER_SECONDS = 60
"""An engine that does not answer within this long is not there [s]."""
PULL_SECONDS = 600


class SkippedError(Exception):
    """There is no engine to test on; the message says what is missing."""


def compose_command() -> list[str]:
    """Return `docker compose` or `docker-compose`, whichever works here.

    Raises:
        SkippedError: if there is no engine, no compose, or a base image can be had from nowhere.
    """
    if shutil.which("docker") is None or not _works("docker", "info"):
        raise SkippedError("no Docker engine answers here")
    candidates = [["docker", "compose"], ["docker-compose"]]
    found = [words for words in candidates if shutil.which(words[0]) and _works(*words, "version")]
    if not found:
        raise SkippedError("neither `docker compose` nor `docker-compose` is there")
    for image in base_images():
        if not has_image(image):
            raise SkippedError(f"the engine has no image {image} and cannot pull it")
    return found[0]


def has_image(image: str) -> bool:
    """Return whether the engine has an image, or can pull it."""
    return _works("docker", "image", "inspect", image) or _works(
        "docker", "pull", image, seconds=PULL_SECONDS
    )


def base_images() -> list[str]:
    """Return what the Dockerfiles start from, without their own stages."""
    names: set[str] = set()
    for path in (ROOT / "deploy/docker").glob("*.Dockerfile"):
        text = path.read_text(encoding="utf-8")
        stages = set(re.findall(r"^FROM \S+ AS (\S+)", text, re.MULTILINE))
        names |= set(re.findall(r"^FROM (\S+)", text, re.MULTILINE)) - stages
    return sorted(names)


def _works(*command: str, seconds: float = ANSWER_SECONDS) -> bool:
    try:
        return subprocess.run(command, capture_output=True, timeout=seconds).returncode == 0
    except subprocess.TimeoutExpired:
        return False
