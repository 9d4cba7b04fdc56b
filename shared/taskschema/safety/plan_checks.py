"""The checks of a motion that need no collision model: shape, start, limits, end."""

from collections.abc import Callable

import numpy as np

from taskschema.arrays import AnyArray, FloatArray
from taskschema.kinematics.sawyer import rethink_gripper, sawyer, sawyer_pair
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import HeldObject, Motion
from taskschema.safety.refusal import Refusal, RefusalKind
from taskschema.skills.pairs import ARMS

ROUNDING = 1e-6
"""Relative excess over a limit that is rounding, not motion."""
JOINTS = 7
LARGEST = 2.0
"""Of a held object, and of its distance from the hand [m]."""
RIGID = 1e-3
"""How far a rotation matrix may be from one."""

Check = Callable[[Motion, FloatArray, SafetyLimits], Refusal | None]


def check_plan(
    motion: Motion, measured: FloatArray, limits: SafetyLimits, held_at: FloatArray | None = None
) -> Refusal | None:
    """Return why a motion must not be made, or None; the sweep comes after.

    Args:
        motion: whatever was asked for.
        measured: [2, 7] where the arms are [rad].
        limits: that hold.
        held_at: [2, 7] set-points that the arms are held at, from which a motion may start, too: an arm that
            presses on something is not where it was sent.
    """
    refusal = check_form(motion, measured, limits)
    if refusal is not None:
        return refusal
    refusal = check_start(motion, measured, limits, held_at)
    if refusal is not None:
        return refusal
    checks: tuple[Check, ...] = (
        check_joint_limits,
        check_rates,
        check_gripper,
        check_end,
    )
    for check in checks:
        refusal = check(motion, measured, limits)
        if refusal is not None:
            return refusal
    return None


def check_form(motion: Motion, measured: FloatArray, limits: SafetyLimits) -> Refusal | None:
    """Check shapes, that every number is finite, the period and the duration."""

    def malformed(reason: str) -> Refusal:
        return Refusal(RefusalKind.MALFORMED, reason)

    if not _is_real(measured, (2, JOINTS)):
        return malformed("the measured joint angles are not two times seven finite numbers")
    joints, opening = motion.joints, motion.opening
    shape = np.shape(joints) if isinstance(joints, np.ndarray) else ()
    if len(shape) != 3 or shape[0] != 2 or shape[2] != JOINTS or shape[1] == 0:
        return malformed(f"joint set-points have shape {shape}, not [2, S, 7]")
    if motion.period != limits.period:
        return malformed(f"set-points every {motion.period!r} s, the arms take one every {limits.period} s")
    longest = round(limits.longest_motion / limits.period)
    if shape[1] > longest:
        reason = f"it takes {shape[1] * limits.period:.0f} s, {limits.longest_motion:g} s is the most"
        return Refusal(RefusalKind.TOO_LONG, reason)
    if not _is_real(joints, shape):
        return malformed("a joint set-point is not a finite number")
    if not _is_real(opening, shape[:2]):
        return malformed("the gripper set-points are not one finite number for each joint set-point")
    for goal in motion.goals:
        if goal is not None and not (_is_real(goal, (2,)) or _is_real(goal, (3,))):
            return malformed("a hand's goal is not two or three finite numbers")
    if not all(held is None or _is_box(held) for held in motion.held):
        return malformed("a held object is no box of at most 2 m in a proper orientation")
    return None


def _is_box(held: HeldObject) -> bool:
    parts = ((held.size, (3,)), (held.position, (3,)), (held.rotation, (3, 3)))
    if not all(_is_real(part, shape) for part, shape in parts):
        return False
    in_bounds = (
        held.size.min() > 0.0 and held.size.max() <= LARGEST and np.abs(held.position).max() <= LARGEST
    )
    if not in_bounds or np.abs(held.rotation).max() > 1.0 + RIGID:
        return False
    return bool(np.abs(held.rotation @ held.rotation.T - np.eye(3)).max() <= RIGID)


def _is_real(array: object, shape: tuple[int, ...]) -> bool:
    return (
        isinstance(array, np.ndarray)
        and array.dtype.kind == "f"
        and array.shape == shape
        and bool(np.isfinite(array).all())
    )


def check_start(
    motion: Motion, measured: FloatArray, limits: SafetyLimits, held_at: FloatArray | None = None
) -> Refusal | None:
    """Check that the first set-point is where the arms are, or are held at and nearly are."""
    error = np.abs(motion.joints[:, 0] - measured)
    if held_at is not None:
        pressing = np.abs(held_at - measured) <= limits.tracking_error
        error = np.where(pressing, np.minimum(error, np.abs(motion.joints[:, 0] - held_at)), error)
    if error.max() <= limits.start_tolerance:
        return None
    arm, joint = np.unravel_index(error.argmax(), error.shape)
    reason = f"its start is {error.max():.3g} rad from where joint {joint} of the {ARMS[arm]} arm is"
    return Refusal(RefusalKind.START, reason, time=0.0, configuration=motion.joints[:, 0].copy())


def check_joint_limits(motion: Motion, measured: FloatArray, limits: SafetyLimits) -> Refusal | None:
    """Check every set-point against the joint limits, with their margin.

    A joint that already stands inside the margin, as after a fault, may stay there but go no further.
    """
    arm = sawyer()
    lower = np.minimum(arm.lower + limits.joint_margin, np.maximum(measured, arm.lower))[:, None]
    upper = np.maximum(arm.upper - limits.joint_margin, np.minimum(measured, arm.upper))[:, None]
    excess = np.maximum(lower - motion.joints, motion.joints - upper)
    return _worst(motion, excess, RefusalKind.JOINT_LIMIT, "beyond its limit, margin included, by {:.3g} rad")


def check_rates(motion: Motion, measured: FloatArray, limits: SafetyLimits) -> Refusal | None:
    """Check velocities and accelerations between set-points, at rest before the first and after the last.

    A path whose acceleration keeps a limit has second differences that keep it, too.
    """
    arm, period, joints = sawyer(), motion.period, motion.joints
    first, last = joints[:, :1], joints[:, -1:]
    padded = np.concatenate([first, first, joints, last, last], axis=1)
    steps = np.diff(padded, axis=1)
    ratio = limits.speed_ratio * (1.0 + ROUNDING)
    velocity = np.abs(steps[:, 1:-2]) / period
    excess = velocity - ratio * arm.velocity
    refusal = _worst(motion, excess, RefusalKind.VELOCITY, "faster than it may by {:.3g} rad/s")
    if refusal is not None:
        return refusal
    acceleration = np.abs(np.diff(steps, axis=1)) / period**2
    excess = acceleration[:, 1:-1] - ratio**2 * arm.acceleration
    return _worst(motion, excess, RefusalKind.ACCELERATION, "accelerates more than it may by {:.3g} rad/s^2")


def _worst(motion: Motion, excess: AnyArray, kind: RefusalKind, words: str) -> Refusal | None:
    """Return a refusal for the first set-point with an excess [2, S, 7] above 0."""
    if not (excess > 0.0).any():
        return None
    index = int(np.flatnonzero((excess > 0.0).any(axis=(0, 2)))[0])
    arm, joint = np.unravel_index(excess[:, index].argmax(), (2, JOINTS))
    step = min(index, len(motion) - 1)
    reason = f"joint {joint} of the {ARMS[arm]} arm {words.format(excess[arm, index, joint])}"
    return Refusal(kind, reason, step * motion.period, motion.joints[:, step].copy())


def check_gripper(motion: Motion, measured: FloatArray, limits: SafetyLimits) -> Refusal | None:
    """Check that the gripper has every opening that it is set to."""
    gripper = rethink_gripper()
    if motion.opening.min() >= gripper.closed - ROUNDING and motion.opening.max() <= gripper.open + ROUNDING:
        return None
    reason = f"a gripper opening outside {gripper.closed:g} to {gripper.open:g} m"
    return Refusal(RefusalKind.GRIPPER, reason)


def check_end(motion: Motion, measured: FloatArray, limits: SafetyLimits) -> Refusal | None:
    """Check the inverse kinematics' residual: whether the hands end at the places they were meant for.

    Height is compared where it was asked for, by a go-to pose or a lift: how high a grasp ends is its own
    affair. A hand that ends too low is the sweep's to refuse; one that ends too high grasps nothing.
    Orientation is not compared: skills are to reach the place before it, and say so.
    """
    for index, (kinematics, goal) in enumerate(zip(sawyer_pair(), motion.goals, strict=True)):
        if goal is None:
            continue
        position, _ = kinematics.forward(motion.joints[index, -1:])
        offset = position[0, : len(goal)] - goal
        beside = float(np.hypot(*offset[:2]))
        above = float(offset[2:].sum())
        if max(beside, abs(above)) > limits.inverse_residual:
            words = f"{100 * beside:.1f} cm beside"
            if abs(above) > beside:
                words = f"{100 * abs(above):.1f} cm {'above' if above > 0.0 else 'below'}"
            reason = f"the {ARMS[index]} hand would end {words} where it was meant to"
            end = motion.joints[:, -1].copy()
            return Refusal(RefusalKind.INVERSE_KINEMATICS, reason, motion.duration, end)
    return None
