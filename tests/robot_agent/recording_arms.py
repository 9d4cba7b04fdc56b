"""Two arms that follow their set-points on a clock that runs as it is asked to, and record what they get."""

from dataclasses import replace

import numpy as np

from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.safety.limits import SafetyLimits
from taskschema.tasks import get_task
from taskschema_robot.drivers.driver import ArmState, GripperState
from taskschema_robot.errors import NotConnectedError
from taskschema_robot.safety.gate import SafetyGate

HOME = get_task("lateral-lifting").home_joints


class SteppedClock:
    """Time passes when somebody sleeps; whoever listens is told."""

    def __init__(self) -> None:
        self.time = 1000.0
        self.events: list[tuple[float, object]] = []

    def now(self) -> float:
        return self.time

    def sleep_until(self, moment: float) -> None:
        self.time = max(self.time, moment)
        while self.events and self.events[0][0] <= self.time:
            self.events.pop(0)[1]()

    def after(self, seconds: float, event) -> None:
        self.events.append((self.time + seconds, event))
        self.events.sort(key=lambda item: item[0])


class RecordingArm:
    """A driver of an arm without inertia; `changes` overlay what its state says."""

    def __init__(self, name: str, clock: SteppedClock, joints: np.ndarray) -> None:
        self.name = name
        self._clock = clock
        self.positions = np.array(joints, dtype=float)
        self.opening = rethink_gripper().open
        self.commands: list[tuple[float, np.ndarray]] = []
        self.stops: list[float] = []
        self.changes: dict[str, object] = {}
        self.follows = True
        self.frozen_at: float | None = None
        self.connected = True
        self.gripper_acknowledged = True
        self.acknowledges = True
        self.stuck = False
        self.refuses: Exception | None = None

    def connect(self) -> None:
        self.connected = True

    def state(self) -> ArmState:
        now = self._clock.now() if self.frozen_at is None else self.frozen_at
        state = ArmState(
            time=now,
            stamp=now,
            positions=self.positions.copy(),
            velocities=np.zeros(7),
            efforts=np.zeros(7),
            wrench=np.zeros(6),
            collision=False,
            enabled=True,
            stopped=bool(self.stops),
            error=False,
            emergency_stop=False,
            gripper=GripperState(self.opening, True, False, False, False),
        )
        return replace(state, **self.changes)

    def command(self, positions: np.ndarray) -> None:
        if self.refuses is not None:
            raise self.refuses
        if not self.connected:
            raise NotConnectedError("down")
        self.commands.append((self._clock.now(), np.array(positions)))
        if self.follows:
            self.positions = np.array(positions)

    def set_speed_ratio(self, ratio: float) -> None:
        self.ratio = ratio

    def set_gripper(self, opening: float) -> None:
        self.gripper_acknowledged = self.acknowledges
        if not self.stuck:
            self.opening = opening

    def calibrate_gripper(self) -> None:
        pass

    def stop(self) -> None:
        self.stops.append(self._clock.now())

    def reset(self) -> None:
        self.stops.clear()
        self.changes.clear()

    def enable(self) -> None:
        self.changes.pop("enabled", None)

    def disable(self) -> None:
        self.changes["enabled"] = False

    def close(self) -> None:
        self.connected = False


class TestBench:
    """A gate between two recording arms."""

    __test__ = False

    def __init__(self, joints: np.ndarray = HOME, limits: SafetyLimits | None = None, monitors=()) -> None:
        self.clock = SteppedClock()
        self.arms = tuple(
            RecordingArm(name, self.clock, row) for name, row in zip(("left", "right"), joints, strict=True)
        )
        self.limits = limits or SafetyLimits()
        self.faults: list[object] = []
        self.gate = SafetyGate(self.arms, self.clock, self.limits, monitors, self.faults.append)

    @property
    def sent(self) -> int:
        return sum(len(arm.commands) for arm in self.arms)

    def positions(self) -> np.ndarray:
        return np.stack([arm.positions for arm in self.arms])
