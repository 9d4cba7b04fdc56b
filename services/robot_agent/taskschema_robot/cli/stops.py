"""What stops both arms from outside of a motion, the same for every command that moves them."""

from collections.abc import Callable
from contextlib import ExitStack

from taskschema_robot.agent.stop_endpoint import StopEndpoint
from taskschema_robot.cli.person import Person


def let_stop(stack: ExitStack, person: Person, stop: Callable[[str], None], stop_port: int | None) -> None:
    """Listen to the stop key, and for `POST /stop`, until the stack is left.

    Args:
        stack: ends the listening.
        person: whose keys they are; nobody has none.
        stop: stops both arms, from any thread.
        stop_port: where the endpoint listens on this machine; None: nowhere.

    """
    person.on_stop(stop)
    stack.enter_context(person.listening())
    if stop_port is not None:
        stack.enter_context(StopEndpoint(stop, stop_port))
