"""What both arms did in the seconds before a fault, in a file."""

import logging
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from taskschema.arrays import AnyArray
from taskschema.skills.pairs import ARMS
from taskschema_robot.agent.kept_files import KeptFiles
from taskschema_robot.safety.fault import Fault

log = logging.getLogger("taskschema.robot")

KEPT = 1_000
"""Files kept; the oldest go."""


class FaultRecord:
    """Writes a file for every fault that is latched: arrays of numbers and words, nothing pickled.

    To be told once both arms have been told to stop. Whatever goes wrong here is only said in the log: the
    fault is what counts.

    Args:
        folder: of the files.
        arms: return what each arm was sent and measured, left arm first.

    """

    def __init__(self, folder: Path, arms: Sequence[Callable[[], dict[str, AnyArray]]]) -> None:
        self._files = KeptFiles(folder, ".npz", KEPT)
        self._arms = arms

    def __call__(self, fault: Fault) -> None:
        """Write what was before a fault."""
        try:
            self._write(fault)
        except Exception:
            log.exception("What was before the fault is not kept")

    def _write(self, fault: Fault) -> None:
        words = {"kind": str(fault.kind), "reason": fault.reason, "time": fault.time}
        arrays = {name: np.array(value) for name, value in words.items()}
        for arm, last_seconds in zip(ARMS, self._arms, strict=True):
            arrays |= {f"{arm}_{name}": values for name, values in last_seconds().items()}
        moment = time.strftime("%Y-%m-%dT%H-%M-%S", time.gmtime(fault.time))
        path = self._files.place(f"{moment}-{fault.kind}")
        np.savez(path, **arrays)  # type: ignore[arg-type]  # no array has the name of an option
        log.info("What both arms did before the fault: %s", path)
