"""Looking for the stack's own secrets wherever somebody may look who must not see them."""

import subprocess
import tempfile
from typing import IO

from tests.compose.secret_search import found_in_archive
from tests.compose.stack import PROJECT, RUN, Stack, docker

IMAGES = ("redis", "worker", "learner", "embedded", "api", "robot")
VOLUMES = {"runs": "/runs", "redis-data": "/data", "episodes": "/episodes"}


def check_secrets_of_running(stack: Stack) -> None:
    """No secret stands in a command line, nor in a file in a container's memory: Ray's logs are there.

    Raises:
        AssertionError: where one is found, or where the search is seen to find nothing at all.

    """
    lines = [docker("top", each, "-eo", "pid,args") for each in stack.containers()]
    _expect_only("taskschema-robot run", _found_in_text(stack, "\n".join(lines)), "process lists")
    for service in ("head", "worker", "learner", "robot-learner", "api", "robot-twin", "robot", "redis"):
        for container in stack.containers(service):
            # Files come and go, sockets cannot be packed: what can be read is what counts.
            words = ["exec", container, "tar", "--create", "--ignore-failed-read", "--directory=/tmp", "."]
            control = "raylet" if service in ("head", "worker", "learner") else None
            _expect_only(control, _found_in_output(stack, words), f"/tmp of {service}")


def check_secrets_at_rest(stack: Stack) -> None:
    """No secret stands in a layer or the history of an image, in a volume, or in a container's log.

    Raises:
        AssertionError: where one is found, or where the search is seen to find nothing at all.

    """
    images = [f"taskschema-{name}:0.1.0" for name in IMAGES]
    _expect_only("@REDIS_LEARNER_SHA256@", _found_in_output(stack, ["save", *images]), "images")
    mounts = [word for name, place in VOLUMES.items() for word in ("-v", f"{PROJECT}_{name}:{place}:ro")]
    words = ["run", "--rm", "--network=none", "--user=10001:10001", *mounts, images[0]]
    packed = _found_in_output(stack, [*words, "tar", "--create", *VOLUMES.values()])
    _expect_only("lateral-lifting", packed, "volumes")
    _expect_only(RUN, _found_in_text(stack, stack.compose("logs", "--no-color")), "containers' logs")


CONTROLS = ("taskschema-robot run", "raylet", "@REDIS_LEARNER_SHA256@", "lateral-lifting", RUN)
"""Texts that are no secrets and must be found: else the search is blind."""


def _expect_only(control: str | None, found: set[str], where: str) -> None:
    leaked = [text[:4] for text in found - set(CONTROLS)]
    assert not leaked, f"secrets that begin with {leaked} are in {where}"
    assert control is None or control in found, f"nothing is found in {where}, not even {control!r}"


def _found_in_text(stack: Stack, text: str) -> set[str]:
    return {each for each in (*stack.secrets, *CONTROLS) if each in text}


def _found_in_output(stack: Stack, words: list[str]) -> set[str]:
    """Search the archive that a docker command writes."""
    with (
        tempfile.TemporaryFile() as errors,
        subprocess.Popen(["docker", *words], stdout=subprocess.PIPE, stderr=errors) as process,
    ):
        output: IO[bytes] | None = process.stdout
        assert output is not None
        return found_in_archive(output, (*stack.secrets, *CONTROLS))
