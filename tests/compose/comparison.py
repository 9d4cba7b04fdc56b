"""Ending a run of the stack, and the same run embedded in one container, to compare the two."""

from collections.abc import Mapping

from tests.compose.stack import RUN, Stack


def finish(stack: Stack, learners: Mapping[str, str]) -> tuple[int, str]:
    """Stop runs, each with the service that learns it; return the finished rounds and the hash of `RUN`."""
    for run, service in learners.items():
        stack.post(f"/runs/{run}/stop")
        stack.wait(lambda service=service: not stack.containers(service), f"the end of {service}")
    return stack.version(), stack.compose("run", "--rm", "-T", "tools", "taskschema", "hash", RUN).strip()


def embedded_hash(stack: Stack, task: str, rounds: int) -> str:
    """Train as many rounds with everything in one container, and return that run's hash."""
    train = f"taskschema train {task} --until-success 0 --rounds {rounds} --api none --run-dir /tmp/embedded"
    words = ("run", "--rm", "-T", "tools", "sh", "-c", f"{train} >&2 && taskschema hash /tmp/embedded")
    return stack.compose(*words).strip()
