"""What keeps the fault that stopped the arms, whatever threads say at the same time."""

import threading

from taskschema_robot.safety.fault import Fault, FaultError


class FaultLatch:
    """Holds the first fault until it is released. Its lock is held for moments: nothing is sent meanwhile."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._fault: Fault | None = None
        self._newest: Fault | None = None
        self._count = 0

    @property
    def fault(self) -> Fault | None:
        """The fault that stands."""
        return self._fault

    @property
    def count(self) -> int:
        """How many faults have been taken so far, those behind the first among them."""
        return self._count

    def take(self, fault: Fault) -> bool:
        """Note a fault; return whether it is the first and stays."""
        with self._lock:
            self._count += 1
            self._newest = fault
            if self._fault is not None:
                return False
            self._fault = fault
            return True

    def demand_none(self) -> None:
        """Raise FaultError if a fault stands."""
        if (fault := self._fault) is not None:
            raise FaultError(fault)

    def demand_none_since(self, count: int) -> None:
        """Raise FaultError if another fault has come since there were `count`: that one stays then."""
        with self._lock:
            self._keep_newest_since(count)

    def release(self, count: int) -> None:
        """Forget the fault, unless another has come since there were `count`; see `demand_none_since`."""
        with self._lock:
            self._keep_newest_since(count)
            self._fault = None

    def _keep_newest_since(self, count: int) -> None:
        if self._count != count and self._newest is not None:
            self._fault = self._newest
            raise FaultError(self._newest)
