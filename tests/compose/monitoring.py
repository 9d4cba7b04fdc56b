"""The profile `monitoring`: Prometheus watches the run from the container that the compose file describes.

Where its image cannot be had, Debian's build of it stands in under its name for as long as the check takes.
"""

import json
import re
import tempfile
from typing import Any

from tests.compose.engine import ROOT, has_image
from tests.compose.stack import RUN, Stack, docker, remove_images

PROFILE = ("--profile", "monitoring")
DOCKERFILE = ROOT / "tests/compose/prometheus.Dockerfile"


def watch_with_prometheus(stack: Stack) -> str:
    """Start Prometheus, wait until it has seen the run and its alert rules, and take it away again.

    Returns:
        What was watched with, for a person.

    Raises:
        TimeoutError: if it never sees the run.

    """
    image = prometheus_image()
    stands_in = not has_image(image)
    if stands_in:
        try:
            with tempfile.TemporaryDirectory() as nothing:
                docker("build", "--quiet", "--tag", image, "--file", str(DOCKERFILE), nothing)
        except RuntimeError:
            return "no Prometheus to be had"
    try:
        stack.compose(*PROFILE, "up", "-d", "--no-build", "prometheus")
        stack.wait(lambda: stack.health("prometheus") == "running healthy", "a healthy Prometheus")
        version = f'query?query=taskschema_policy_version{{run="{RUN}"}}'
        stack.wait(lambda: bool(_ask(stack, version)["result"]), "the run in Prometheus")
        rules = {rule["name"] for group in _ask(stack, "rules")["groups"] for rule in group["rules"]}
        assert "RunStalled" in rules, rules
    finally:
        stack.compose(*PROFILE, "rm", "--stop", "--force", "prometheus")
        if stands_in:
            remove_images([image])
    return "Debian's Prometheus in its image's place" if stands_in else image


def prometheus_image() -> str:
    """Return the image's name in the compose file."""
    match = re.search(r"image: (prom/prometheus:\S+)", (ROOT / "docker-compose.yml").read_text("utf-8"))
    assert match is not None
    return match[1]


def _ask(stack: Stack, question: str) -> Any:
    """Return what Prometheus answers, within its container: nobody outside reaches it."""
    url = f"http://127.0.0.1:9090/api/v1/{question}"
    answer = stack.compose(*PROFILE, "exec", "-T", "prometheus", "wget", "-q", "-O", "-", url)
    return json.loads(answer)["data"]
