"""The one thing about the gate that the loop needs and an executor must not have."""

from typing import Protocol


class AcknowledgedArms(Protocol):
    """Arms whose latched fault a person can acknowledge."""

    def acknowledge(self, person: str) -> None:
        """Clear the latched fault in a person's name.

        Raises:
            FaultError: if both were stopped meanwhile.
            RobotError: if an arm is away or cannot be enabled; the fault then stays.
        """
        ...
