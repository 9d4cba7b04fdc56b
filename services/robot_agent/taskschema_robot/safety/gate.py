"""The gate: holds the drivers of both arms, and lets checked motions through and nothing else."""

import logging
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
from taskschema.safety.sweep import PARTING, RECOVERY, Sweep
from taskschema.skills.pairs import ARMS
from taskschema_robot.clock import Clock
from taskschema_robot.drivers.driver import ArmDriver, ArmState
from taskschema_robot.errors import RobotError
from taskschema_robot.safety.fault import Fault, FaultError, FaultKind
from taskschema_robot.safety.fault_latch import FaultLatch
from taskschema_robot.safety.readiness import await_stop, make_ready, watch_connections
from taskschema_robot.safety.watchdog import (
    Monitor,
    obeyed,
    relaxed,
    watch_monitors,
    watch_states,
    watch_tracking,
)

log = logging.getLogger("taskschema.robot.safety")

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
        self._latched = FaultLatch()
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
        return self._latched.fault

    def states(self) -> tuple[ArmState, ArmState]:
        """Return the newest states, left arm first; see `GatedArms`."""
        return self._drivers[0].state(), self._drivers[1].state()

    def check(self, motion: Motion, *, parting: bool = False, recovering: bool = False) -> Refusal | None:
        """Return why a motion would be refused; see `GatedArms`."""
        measured = np.stack([state.positions for state in self.states()])
        leeway = RECOVERY if recovering else PARTING if parting else None
        return check_plan(motion, measured, self._limits, self._held_at) or self._sweep.check(
            motion, measured, leeway=leeway
        )

    def execute(self, motion: Motion, *, parting: bool = False, recovering: bool = False) -> Refusal | None:
        """Make a motion, or refuse it; see `GatedArms`."""
        self._watched = relaxed(self._limits, self.states()) if recovering else self._limits
        self._guards = tuple(item for item in self._monitors if item.guards_recovery or not recovering)
        self._demand_health()
        refusal = self.check(motion, parting=parting, recovering=recovering)
        if refusal is not None:
            log.info("Refused (%s): %s", refusal.kind, refusal.reason)
            return refusal
        try:
            self._stream(motion)
            self._settle(motion)
        except FaultError:
            raise
        except BaseException as error:
            self._latch(Fault(FaultKind.AGENT, f"the agent itself failed: {error!r}", self._clock.now()))
            raise
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
            RobotError: if an arm is away or cannot be enabled, or both were stopped.

        """
        try:
            for driver in self._drivers:
                self._latched.demand_none()
                make_ready(driver)
                self._latched.demand_none()
                if not driver.state().gripper.calibrated:
                    driver.calibrate_gripper()
            self._latched.demand_none()
        except RobotError:
            if self._latched.fault is not None:  # what was made ready may have ended the stop
                self._stop_arms()
            raise

    def acknowledge(self, person: str) -> None:
        """Clear the latched fault in a person's name: reset what is stopped and enable the arms.

        A stop that comes meanwhile is not lost: both arms are stopped again, and that stop is latched.

        Raises:
            FaultError: if both were stopped meanwhile.
            RobotError: if an arm is away or cannot be enabled; the fault then stays.

        """
        count, fault = self._latched.count, self._latched.fault
        if fault is None:
            return
        try:
            await_stop(self._drivers, self._clock)
            for driver in self._drivers:
                self._latched.demand_none_since(count)
                make_ready(driver)
            self._keep_grips()
            self._latched.release(count)
        except RobotError as error:
            self._stop_arms()
            if isinstance(error, FaultError):
                self._tell(error.fault)
            raise
        log.warning("%s acknowledged: %s", person, fault.reason)

    def _keep_grips(self) -> None:
        """Let a gripper keep what it holds, untold; any other is told again. Arms start where they are."""
        grips = [state.gripper.gripping and self._is_closing(arm) for arm, state in enumerate(self.states())]
        self._openings = [self._openings[arm] if grips[arm] else None for arm in (0, 1)]
        self._orders, self._held_at = [None, None], None

    # During a motion

    def _demand_health(self) -> None:
        """Raise FaultError unless everything is well now."""
        self._latched.demand_none()
        now = self._clock.now()
        fault = watch_connections(self._drivers, now) or watch_states(self.states(), now, self._watched)
        fault = fault or watch_monitors(self._guards, now)
        if fault is not None:
            self._latch(fault)
        self._latched.demand_none()

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
        self._latched.demand_none()
        now, states = self._clock.now(), self.states()
        fault = (
            watch_connections(self._drivers, now)
            or watch_states(states, now, self._watched)
            or watch_tracking(states, np.array(recent).swapaxes(0, 1), now, self._limits)
            or watch_monitors(self._guards, now)
        )
        if fault is not None:
            self._latch(fault)
            raise FaultError(fault)
        return states

    def _send(self, joints: FloatArray) -> None:
        """Send one set-point to both arms; a driver that was told to stop meanwhile refuses it."""
        for driver, positions in zip(self._drivers, joints, strict=True):
            self._latched.demand_none()
            try:
                driver.command(positions)
            except RobotError as error:
                self._fail(FaultKind.COMMAND, f"the {driver.name} arm did not take a set-point: {error}")
        self._held_at = joints

    def _set_grippers(self, motion: Motion, index: int) -> None:
        """Send an opening where it changes."""
        for arm, driver in enumerate(self._drivers):
            opening = float(motion.opening[arm, index])
            if opening == self._openings[arm]:
                continue
            self._latched.demand_none()
            try:
                driver.set_gripper(opening)
            except RobotError as error:
                self._fail(FaultKind.COMMAND, f"the {driver.name} gripper did not take a command: {error}")
            self._openings[arm] = self._orders[arm] = opening
            self._opened_before[arm] = driver.state().gripper.opening

    def _fail(self, kind: FaultKind, reason: str) -> NoReturn:
        self._latch(fault := Fault(kind, reason, self._clock.now()))
        raise FaultError(self._latched.fault or fault)

    def _latch(self, fault: Fault) -> None:
        """Stop both arms, first of all, without waiting for anything; the first fault is the one that stays.

        It is noted before, so that nothing is sent after the stop, and after, so that an acknowledgement that
        had no eyes for it yet, and may have ended the stop, finds it.
        """
        first = self._latched.take(fault)
        self._stop_arms()
        first = self._latched.take(fault) or first
        if first:
            self._tell(fault)

    def _stop_arms(self) -> None:
        for driver in self._drivers:
            driver.stop()

    def _tell(self, fault: Fault) -> None:
        log.error("FAULT (%s): %s", fault.kind, fault.reason)
        if self._on_fault is not None:
            self._on_fault(fault)
