"""Arms that wait for a person before every motion."""

import logging
import time
from collections.abc import Callable

from taskschema.safety.motion import Motion
from taskschema.safety.refusal import Refusal
from taskschema_robot.agent.world import NobodyThereError
from taskschema_robot.drivers.driver import ArmState
from taskschema_robot.safety.fault import Fault
from taskschema_robot.safety.gated_arms import GatedArms

log = logging.getLogger("taskschema.robot")

LOOK_SECONDS = 0.02
PATIENCE = 60.0
"""How long to wait for the key before one motion [s]."""


class AttendedArms:
    """Arms behind the gate that begin no motion before a person holds the key down; see `GatedArms`.

    To wait is no fault: the arms stand still. During the motion the gate itself watches the key.

    Args:
        arms: behind the gate.
        held: whether the key is held down.
        ask: asks a person to hold it.
        patience: how long to wait for it [s].

    """

    def __init__(
        self,
        arms: GatedArms,
        held: Callable[[], bool],
        ask: Callable[[], None],
        patience: float = PATIENCE,
    ) -> None:
        self._arms, self._held, self._ask, self._patience = arms, held, ask, patience

    @property
    def fault(self) -> Fault | None:
        """What stopped the arms; see `GatedArms`."""
        return self._arms.fault

    def states(self) -> tuple[ArmState, ArmState]:
        """Return the newest states; see `GatedArms`."""
        return self._arms.states()

    def check(self, motion: Motion, *, parting: bool = False, recovering: bool = False) -> Refusal | None:
        """Return why a motion would be refused; see `GatedArms`."""
        return self._arms.check(motion, parting=parting, recovering=recovering)

    def execute(self, motion: Motion, *, parting: bool = False, recovering: bool = False) -> Refusal | None:
        """Make a motion once the key is held, or refuse it at once; see `GatedArms`.

        Raises:
            NobodyThereError: if nobody holds the key in time.

        """
        refusal = self._arms.check(motion, parting=parting, recovering=recovering)
        if refusal is not None:  # the gate would look for the key first
            log.info("Refused (%s): %s", refusal.kind, refusal.reason)
            return refusal
        self._wait()
        return self._arms.execute(motion, parting=parting, recovering=recovering)

    def stop(self, reason: str) -> None:
        """Stop both arms; see `GatedArms`."""
        self._arms.stop(reason)

    def _wait(self) -> None:
        """Return once the key is held, or a fault is latched: the gate says so then."""
        if self._held():
            return
        self._ask()
        deadline = time.monotonic() + self._patience
        while not self._held() and self._arms.fault is None:
            if time.monotonic() > deadline:
                log.info("Nobody held the hold-to-run key for %.0f s", self._patience)
                raise NobodyThereError(
                    f"Nobody held the hold-to-run key within {self._patience:.0f} s: the arms have not moved."
                )
            time.sleep(LOOK_SECONDS)
