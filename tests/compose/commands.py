"""What docs/deploy.md and docs/operate.md have a person type, typed as it stands there."""

from tests.compose.documented import script
from tests.compose.stack import ROBOT_RUN, RUN, Stack

QUESTIONS = {
    "docker compose run --rm tools taskschema schema lateral-lifting --compare-paper": ("", "Schema found: "),
    "docker compose run --rm tools taskschema schema lateral-lifting --export /runs/schema.json": (
        "",
        "policy version",
    ),
    "docker compose run --rm tools taskschema eval lateral-lifting": (
        "--episodes 10",
        "on 10 held-out instances",
    ),
    "docker compose run --rm tools taskschema verify lateral-lifting": ("--rounds 2", "The same: 2 rounds"),
    "docker compose run --rm tools taskschema hash lateral-lifting": ("", "\n"),
}
"""Commands about a run that has ended; what makes them shorter here, and a text that the answer must hold."""
TOKEN = "$(sed -n 's/^TASKSCHEMA_API_READ_TOKEN=//p' .env)"
SCHEMA = f'curl -H "Authorization: Bearer {TOKEN}" 127.0.0.1:8420/schema'
FAULT = (
    "docker compose --profile robot exec robot-twin "
    "taskschema-robot fault press-emergency-stop --arm left --twin unix:/twin/control"
)
BACKUP, RESTORE, UPGRADE = "Back up in containers", "Restore in containers", "Upgrade in containers"
"""Blocks of docs/operate.md, which are run as a whole."""


def ask_the_tools(stack: Stack) -> None:
    """Ask everything about a run that has ended.

    Raises:
        RuntimeError: if a command fails.
        AssertionError: if its answer lacks what it is asked for.

    """
    assert '"logits"' in stack.shell(f"{SCHEMA}?run={RUN}")
    for command, (further, expected) in QUESTIONS.items():
        answer = stack.shell(f"{command} {further}")
        assert expected in answer, f"{command}: {answer}"


def press_the_emergency_stop(stack: Stack) -> float:
    """Press the twin's button and release it again; return how long the next round took after that [s]."""
    starts = stack.engine_starts("robot")
    assert stack.shell(FAULT) == "press-emergency-stop: on, left\n"
    # Unattended, it cannot look why, so that it ends, and does not move when it is started again.
    stack.wait(lambda: stack.engine_starts("robot") > starts, "a robot that the button stopped")
    version, starts = stack.version(ROBOT_RUN), stack.engine_starts("robot")
    stack.wait(lambda: stack.engine_starts("robot") > starts, "a robot that was started in vain")
    assert stack.version(ROBOT_RUN) == version, "a round passed while the emergency stop was pressed"
    assert "emergency stop" in stack.compose("--profile", "robot", "logs", "--no-color", "robot")
    assert stack.shell(f"{FAULT} --off") == "press-emergency-stop: over, left\n"
    return stack.rounds_pass(1, ROBOT_RUN)


def back_up(stack: Stack) -> None:
    """Copy the run while it trains."""
    stack.shell(script("operate.md", BACKUP))


def restore_and_upgrade(stack: Stack, sha256: str, rounds: int) -> None:
    """Put an older copy in the place of the run, which comes to the same hash again; then upgrade.

    Args:
        stack: whose run has ended.
        sha256: of the run when it had ended.
        rounds: that it had made.

    Raises:
        AssertionError: if the run is another one than before.

    """
    stack.change("TASKSCHEMA_OPTIONS", f"--until-success 0 --rounds {rounds}")
    stack.shell(script("operate.md", RESTORE))
    stack.wait(lambda: not stack.containers("learner"), "the end of the restored run")
    restored = stack.compose("run", "--rm", "-T", "tools", "taskschema", "hash", RUN).strip()
    assert restored == sha256, f"restored, the run's hash after {rounds} rounds is {restored}, not {sha256}"
    stack.change("TASKSCHEMA_OPTIONS", "--until-success 0")
    stack.shell(script("operate.md", UPGRADE))
    stack.rounds_pass(1)
