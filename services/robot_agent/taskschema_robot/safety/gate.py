"""The gate: holds the drivers of both arms, and lets checked motions through and nothing else."""

import dataclasses
import logging
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import NoReturn

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import Motion
from taskschema.safety.plan_checks import check_plan
from taskschema.safety.refusal import Refusal
from taskschema.safety.sweep import Sweep
from taskschema.skills.pairs import ARMS
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmDriver, ArmState
from taskschema_robot.errors import RobotError
from taskschema_robot.safety.fault import Fault, FaultError, FaultKind
from taskschema_robot.safety.readiness import await_stop, make_ready
from taskschema_robot.safety.watchdog import Monitor, obeyed, watch_monitors, watch_states, watch_tracking

log = logging.getLogger("taskschema.robot.safety")

RECOVERY_WRENCH = 1.2
"""How many times the wrench at its start a recovery may meet: arms that are pressed against something."""

Listener = Callable[[Fault], None]


class SafetyGate:
    """Both arms behind the gate; see `GatedArms`. The only object in the agent that commands a driver.

    Args:
        drivers: of the left and the right arm, connected by `prepare`.
        clock: the agent's.
        limits: of every check.
        monitors: what else has to be well during a motion.
        on_fault: told about every fault once both arms have been told to stop.

    """

    def __init__(
        self,
        drivers: tuple[ArmDriver, ArmDriver],
        clock: Clock,
        limits: SafetyLimits,
        monitors: Sequence[Monitor] = (),
        on_fault: Listener | None = None,
    ) -> None:
        self._drivers = drivers
        self._clock = clock
        self._limits = limits
        self._monitors = self._guards = tuple(monitors)
        self._on_fault = on_fault
        self._sweep = Sweep(limits)
        self._lock = threading.Lock()
        self._fault: Fault | None = None
        self._openings: list[float | None] = [None, None]
        self._orders: list[float | None] = [None, None]
        self._opened_before = [0.0, 0.0]
        self._held_at: FloatArray | None = None
        self._watched = limits

    @property
    def limits(self) -> SafetyLimits:
        """What is allowed."""
        return self._limits

    @property
    def fault(self) -> Fault | None:
        """What stopped the arms, until it is acknowledged; see `GatedArms`."""
        return self._fault

    def states(self) -> tuple[ArmState, ArmState]:
        """Return the newest states, left arm first; see `GatedArms`."""
        return self._drivers[0].state(), self._drivers[1].state()

    def check(self, motion: Motion, *, recovering: bool = False) -> Refusal | None:
        """Return why a motion would be refused; see `GatedArms`."""
        measured = np.stack([state.positions for state in self.states()])
        return check_plan(motion, measured, self._limits, self._held_at) or self._sweep.check(
            motion, measured, recovering=recovering
        )

    def execute(self, motion: Motion, *, recovering: bool = False) -> Refusal | None:
        """Make a motion, or refuse it; see `GatedArms`."""
        self._watched = self._relaxed() if recovering else self._limits
        self._guards = tuple(item for item in self._monitors if item.guards_recovery or not recovering)
        self._demand_health()
        refusal = self.check(motion, recovering=recovering)
        if refusal is not None:
            log.info("Refused (%s): %s", refusal.kind, refusal.reason)
            return refusal
        self._stream(motion)
        self._settle(motion)
        return None

    def stop(self, reason: str) -> None:
        """Stop both arms and latch it; see `GatedArms`."""
        self._latch(Fault(FaultKind.REQUESTED, reason, self._clock.now()))

    def connect(self) -> None:
        """Connect what is not connected; nothing is switched on.

        Raises:
            NotConnectedError: if an arm is away.

        """
        for driver in self._drivers:
            if not driver.connected:
                driver.connect()

    def prepare(self) -> None:
        """Connect what is not connected, enable the arms and calibrate grippers: the fingers move.

        Raises:
            RobotError: if an arm is away or cannot be enabled.

        """
        for driver in self._drivers:
            make_ready(driver)
            if not driver.state().gripper.calibrated:
                driver.calibrate_gripper()

    def acknowledge(self, person: str) -> None:
        """Clear the latched fault in a person's name: reset what is stopped and enable the arms.

        Raises:
            RobotError: if an arm is away or cannot be enabled; the fault then stays.

        """
        fault = self._fault
        if fault is None:
            return
        await_stop(self._drivers, self._clock)
        for driver in self._drivers:
            make_ready(driver)
        # A gripper that holds something is told nothing: it keeps it. Any other is told again.
        grips = [state.gripper.gripping and self._is_closing(arm) for arm, state in enumerate(self.states())]
        self._openings = [self._openings[arm] if grips[arm] else None for arm in (0, 1)]
        self._orders, self._held_at = [None, None], None
        log.warning("%s acknowledged: %s", person, fault.reason)
        with self._lock:
            self._fault = None

    def _relaxed(self) -> SafetyLimits:
        """Return limits under which arms that press on something already may leave it."""
        wrenches = np.stack([state.wrench for state in self.states()])
        force, torque = (
            np.sqrt((part * part).sum(axis=1)).max() for part in (wrenches[:, :3], wrenches[:, 3:])
        )
        if not np.isfinite(force + torque):
            return self._limits
        return dataclasses.replace(
            self._limits,
            force=max(self._limits.force, RECOVERY_WRENCH * float(force)),
            torque=max(self._limits.torque, RECOVERY_WRENCH * float(torque)),
        )

    # During a motion

    def _demand_health(self) -> None:
        """Raise FaultError unless everything is well now."""
        if self._fault is None:
            now = self._clock.now()
            fault = self._disconnected(now) or watch_states(self.states(), now, self._watched)
            fault = fault or watch_monitors(self._guards, now)
            if fault is not None:
                self._latch(fault)
        if self._fault is not None:
            raise FaultError(self._fault)

    def _disconnected(self, now: float) -> Fault | None:
        for driver in self._drivers:
            if not driver.connected:
                return Fault(FaultKind.CONNECTION, f"{driver.name} arm: its connection is down", now)
        return None

    def _stream(self, motion: Motion) -> None:
        """Send the set-points at their period; what is checked is what is sent.

        A stall moves all later set-points, so that none are sent in a burst; a long one is a fault.
        """
        window = round(self._limits.tracking_delay / motion.period)
        recent: deque[FloatArray] = deque([motion.joints[:, 0]], maxlen=window)
        due = self._clock.now()
        for index in range(len(motion)):
            self._clock.sleep_until(due)
            now = self._clock.now()
            if now - due > self._limits.late:
                self._fail(FaultKind.LATE, f"set-points came to a halt for {now - due:.2f} s")
            due = max(due, now - 0.5 * motion.period) + motion.period
            self._watch(recent)
            self._send(motion.joints[:, index])
            self._set_grippers(motion, index)
            recent.append(motion.joints[:, index])

    def _settle(self, motion: Motion) -> None:
        """Hold the last set-point until both arms have arrived and their grippers rest."""
        goal = motion.joints[:, -1]
        window = min(round(self._limits.tracking_delay / motion.period), len(motion))
        recent: deque[FloatArray] = deque(motion.joints[:, -window:].swapaxes(0, 1), maxlen=window)
        deadline = self._clock.now() + self._limits.arrival_seconds
        while True:
            self._clock.sleep_until(self._clock.now() + motion.period)
            states = self._watch(recent)
            error = np.abs(np.array([state.positions for state in states]) - goal)
            waiting = self._waiting_gripper(states)
            if error.max() <= self._limits.arrival_tolerance and waiting is None:
                return
            if self._clock.now() > deadline:
                arm, joint = np.unravel_index(error.argmax(), error.shape)
                if error.max() > self._limits.arrival_tolerance:
                    reason = f"joint {joint} of the {ARMS[arm]} arm is {error.max():.2f} rad short of the end"
                    self._fail(FaultKind.ARRIVAL, reason)
                self._fail(FaultKind.GRIPPER, f"the {waiting} gripper has not done what it was told")
            self._send(goal)
            recent.append(goal)

    def _waiting_gripper(self, states: Sequence[ArmState]) -> str | None:
        """Return whose gripper has not acknowledged its command, still moves, or did not obey."""
        orders = zip(self._drivers, states, self._orders, self._opened_before, strict=True)
        for driver, state, opening, before in orders:
            waiting = opening is not None and not driver.gripper_acknowledged
            if waiting or state.gripper.moving or not obeyed(state.gripper, opening, before):
                return driver.name
        return None

    def _is_closing(self, arm: int) -> bool:
        """Return whether a gripper was last told to close."""
        opening = self._openings[arm]
        return opening is not None and opening <= rethink_gripper().closed

    def _watch(self, recent: deque[FloatArray]) -> tuple[ArmState, ArmState]:
        """Return the states if everything is well; latch the fault and raise otherwise."""
        if self._fault is not None:
            raise FaultError(self._fault)
        now, states = self._clock.now(), self.states()
        fault = (
            self._disconnected(now)
            or watch_states(states, now, self._watched)
            or watch_tracking(states, np.array(recent).swapaxes(0, 1), now, self._limits)
            or watch_monitors(self._guards, now)
        )
        if fault is not None:
            self._latch(fault)
            raise FaultError(fault)
        return states

    def _send(self, joints: FloatArray) -> None:
        """Send one set-point to both arms, unless a stop came in between."""
        with self._lock:
            if self._fault is not None:
                raise FaultError(self._fault)
            try:
                for driver, positions in zip(self._drivers, joints, strict=True):
                    driver.command(positions)
                self._held_at = joints
                return
            except RobotError as error:
                reason = f"the {driver.name} arm did not take a set-point: {error}"
        self._fail(FaultKind.COMMAND, reason)

    def _set_grippers(self, motion: Motion, index: int) -> None:
        """Send an opening where it changes."""
        for arm, driver in enumerate(self._drivers):
            opening = float(motion.opening[arm, index])
            if opening == self._openings[arm]:
                continue
            try:
                driver.set_gripper(opening)
            except RobotError as error:
                self._fail(FaultKind.COMMAND, f"the {driver.name} gripper did not take a command: {error}")
            self._openings[arm] = self._orders[arm] = opening
            self._opened_before[arm] = driver.state().gripper.opening

    def _fail(self, kind: FaultKind, reason: str) -> NoReturn:
        self._latch(Fault(kind, reason, self._clock.now()))
        assert self._fault is not None
        raise FaultError(self._fault)

    def _latch(self, fault: Fault) -> None:
        """Stop both arms, first of all; the first fault is the one that stays."""
        with self._lock:
            for driver in self._drivers:
                driver.stop()
            first = self._fault is None
            if first:
                self._fault = fault
        if first:
            log.error("FAULT (%s): %s", fault.kind, fault.reason)
            if self._on_fault is not None:
                self._on_fault(fault)
