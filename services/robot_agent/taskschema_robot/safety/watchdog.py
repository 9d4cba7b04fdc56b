"""The checks during a motion: pure functions of the arms' states, and monitors of everything else."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.safety.limits import SafetyLimits
from taskschema.skills.pairs import ARMS
from taskschema_robot.drivers.driver import ArmState, GripperState
from taskschema_robot.safety.fault import Fault, FaultKind

RECOVERY_WRENCH = 1.2
"""How many times the wrench at its start a recovery may meet: arms that are pressed against something."""
OPEN_TRAVEL = 0.02
"""Of a gripper that was told to open [m]: half of what an electric gripper can do."""
LEAST_TRAVEL = 0.001
"""Of fingers that close on something [m]: nothing is as wide as the open gripper."""


class Monitor(Protocol):
    """Something beside the arms that has to be well while they move: a camera, Redis, a person's key."""

    guards_recovery: bool
    """Whether it must be well, too, while a person who acknowledged a fault has the arms brought home: what
    only training needs must not keep them in the air."""

    def fault(self, now: float) -> Fault | None:
        """Return what is wrong at `now` [s] on the agent's clock; does not wait."""
        ...


def relaxed(limits: SafetyLimits, states: Sequence[ArmState]) -> SafetyLimits:
    """Return limits under which arms that press on something already may leave it."""
    wrenches = np.stack([state.wrench for state in states])
    force, torque = (np.sqrt((part * part).sum(axis=1)).max() for part in (wrenches[:, :3], wrenches[:, 3:]))
    if not np.isfinite(force + torque):
        return limits
    return dataclasses.replace(
        limits,
        force=max(limits.force, RECOVERY_WRENCH * float(force)),
        torque=max(limits.torque, RECOVERY_WRENCH * float(torque)),
    )


def watch_states(states: Sequence[ArmState], now: float, limits: SafetyLimits) -> Fault | None:
    """Return what is wrong with the arms themselves, the gravest first."""
    for arm, state in zip(ARMS, states, strict=True):
        found = _wrong(state, now, limits)
        if found is not None:
            kind, reason = found
            return Fault(kind, f"{arm} arm: {reason}", now)
    return None


def _wrong(state: ArmState, now: float, limits: SafetyLimits) -> tuple[FaultKind, str] | None:
    age = now - state.time
    force, torque = (math.hypot(*part) for part in (state.wrench[:3].tolist(), state.wrench[3:].tolist()))
    finite = np.isfinite(np.concatenate([state.positions, state.velocities, state.wrench])).all()
    if state.emergency_stop:
        return FaultKind.EMERGENCY_STOP, "its emergency stop is pressed"
    if state.collision:
        return FaultKind.COLLISION, "it has detected a collision"
    if state.error:
        return FaultKind.ROBOT_ERROR, "it reports an error"
    if state.stopped:
        return FaultKind.STOPPED, "it is stopped"
    if not state.enabled:
        return FaultKind.NOT_ENABLED, "it is not enabled"
    if not age <= limits.state_age:
        return FaultKind.STATE_AGE, f"its last state is {age:.2f} s old"
    for source in state.sources:
        silence = now - source.time
        if not silence <= source.longest:
            return FaultKind.STATE_AGE, f"nothing has come from {source.name} for {silence:.2f} s"
    if not finite:
        return FaultKind.STATE_AGE, "its state holds numbers that are not finite"
    if force > limits.force:
        return FaultKind.WRENCH, f"a force of {force:.0f} N at the hand, {limits.force:.0f} N is the most"
    if torque > limits.torque:
        return (
            FaultKind.WRENCH,
            f"a torque of {torque:.0f} Nm at the hand, {limits.torque:.0f} Nm is the most",
        )
    if state.gripper.error:
        return FaultKind.GRIPPER, "its gripper reports an error"
    return None


def watch_tracking(
    states: Sequence[ArmState], recent: FloatArray, now: float, limits: SafetyLimits
) -> Fault | None:
    """Return which joint is not on its way along the recent set-points [2, R, 7], if one is not."""
    low, high = recent.min(axis=1), recent.max(axis=1)
    measured = np.array([state.positions for state in states])
    error = np.maximum(low - measured, measured - high)
    if error.max() <= limits.tracking_error:
        return None
    arm, joint = np.unravel_index(error.argmax(), error.shape)
    reason = f"{ARMS[arm]} arm: joint {joint} is {error.max():.2f} rad from where it was sent"
    return Fault(FaultKind.TRACKING, reason, now)


def obeyed(gripper: GripperState, opening: float | None, before: float) -> bool:
    """Return whether a gripper at rest is where it was sent: closed, on an object, or clearly open.

    Args:
        gripper: what it says of itself; fingers that are stuck look to it as if they held something.
        opening: that it was sent to [m]; None: it was sent nowhere.
        before: its opening when it was sent there [m].
    """
    if opening is None:
        return True
    model = rethink_gripper()
    middle = 0.5 * (model.closed + model.open)
    if opening < middle:
        return gripper.opening < middle or (gripper.gripping and before - gripper.opening > LEAST_TRAVEL)
    return gripper.opening > model.closed + OPEN_TRAVEL


def watch_monitors(monitors: Sequence[Monitor], now: float) -> Fault | None:
    """Return the first fault of the monitors."""
    for monitor in monitors:
        fault = monitor.fault(now)
        if fault is not None:
            return fault
    return None
