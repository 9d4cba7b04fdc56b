"""What everybody but the gate sees of the arms."""

from typing import Protocol

from taskschema.safety.motion import Motion
from taskschema.safety.refusal import Refusal
from taskschema_robot.drivers.driver import ArmState
from taskschema_robot.safety.fault import Fault


class GatedArms(Protocol):
    """Both arms, behind the safety gate: whoever executes skills gets this, never a driver."""

    @property
    def fault(self) -> Fault | None:
        """What stopped the arms, until it is acknowledged."""
        ...

    def states(self) -> tuple[ArmState, ArmState]:
        """Return the newest states, left arm first.

        Raises:
            NotConnectedError: if an arm has never sent one.
        """
        ...

    def check(self, motion: Motion, *, parting: bool = False, recovering: bool = False) -> Refusal | None:
        """Return why a motion from where the arms are would be refused; nothing moves."""
        ...

    def execute(self, motion: Motion, *, parting: bool = False, recovering: bool = False) -> Refusal | None:
        """Make a motion of both arms, or refuse it; returns when the arms have arrived and rest.

        Args:
            motion: from where the arms are.
            parting: on the way home: shapes that are too near each other already may part, but not come
                nearer. Monitors and limits are those of any motion.
            recovering: on the way home after a fault that a person has acknowledged: such shapes may come a
                little nearer, what presses on a hand already may go on, and only the monitors that guard a
                recovery count.

        Raises:
            FaultError: if a fault is latched, or one stops the motion.
        """
        ...

    def stop(self, reason: str) -> None:
        """Stop both arms at once and latch it as a fault: not safety rated. From any thread."""
        ...
