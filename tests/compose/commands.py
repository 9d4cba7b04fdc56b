"""What docs/deploy.md has a person type, beside what the check does anyway."""

from tests.compose.stack import ROBOT_RUN, RUN, Stack

TOOLS = {
    "taskschema schema {run} --compare-paper": "Schema found: ",
    "taskschema schema {run} --export /runs/schema.json": "policy version",
    "taskschema eval {run} --episodes 10": "on 10 held-out instances",
    "taskschema verify {run} --rounds 2": "The same: 2 rounds",
}
"""Commands in the container `tools`, and a text that the answer must hold."""
FAULT = "taskschema-robot fault press-emergency-stop --arm left --twin unix:/twin/control"


def ask_the_tools(stack: Stack) -> None:
    """Ask everything about a run that has ended.

    Raises:
        RuntimeError: if a command fails.
        AssertionError: if its answer lacks what it is asked for.

    """
    for command, expected in TOOLS.items():
        words = command.format(run=RUN)
        answer = stack.compose("run", "--rm", "-T", "tools", *words.split())
        assert expected in answer, f"{words}: {answer}"


def press_the_emergency_stop(stack: Stack) -> float:
    """Press the twin's button and release it again; return how long the next round took after that [s]."""
    in_twin = ("--profile", "robot", "exec", "-T", "robot-twin")
    starts = stack.engine_starts("robot")
    assert stack.compose(*in_twin, *FAULT.split()) == "press-emergency-stop: on, left\n"
    # Unattended, it cannot look why, so that it ends, and does not move when it is started again.
    stack.wait(lambda: stack.engine_starts("robot") > starts, "a robot that the button stopped")
    assert "emergency stop" in stack.compose("--profile", "robot", "logs", "--no-color", "robot")
    assert stack.compose(*in_twin, *FAULT.split(), "--off") == "press-emergency-stop: over, left\n"
    return stack.rounds_pass(1, ROBOT_RUN)
