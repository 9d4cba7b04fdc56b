"""Ways back to a pose where both arms are clear of the table: after an episode, and after a fault."""

import logging
from collections.abc import Callable, Iterator

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.sawyer import sawyer_pair
from taskschema.motion import ArmPath
from taskschema.motion.timing import fastest_path
from taskschema.safety.motion import Motion
from taskschema_robot.safety.fault import FaultError, RecoveryError
from taskschema_robot.safety.gated_arms import GatedArms

log = logging.getLogger("taskschema.robot.safety")

PARTING_RATIO = 0.1
"""Speed ratio at which arms part that are too near each other."""
RETREAT = 0.1
"""[m] that a hand backs off along its fingers."""
RISE = 0.12
"""[m] that a hand rises."""
CLEAR_HEIGHT = 0.3
"""Height of an end effector [m] above which a hand need not rise."""
NEARLY = 0.1
"""Joints that are all so near home need no detour [rad]."""


def return_home(
    arms: GatedArms,
    home: FloatArray,
    opening: FloatArray,
    *,
    period: float,
    speed_ratio: float,
    recovering: bool = False,
) -> None:
    """Bring both arms to `home` [2, 7] along the first way that the gate lets through.

    Arms that ended a motion a little nearer than they may be part slowly, and never come nearer.

    Args:
        arms: behind the gate.
        home: joint angles [rad].
        opening: [2] gripper set-points on the way [m].
        period: of the set-points [s].
        speed_ratio: of the motion.
        recovering: after a fault that a person has acknowledged; see `GatedArms.execute`.

    Raises:
        FaultError: if a fault stops the arms, or the gate refuses every way: with `recovering`, a person who
            has seen them may let them try again.
        RecoveryError: if it refuses every way even then.

    """
    measured = np.stack([state.positions for state in arms.states()])
    reasons = []
    manners = [(False, speed_ratio)]
    if not recovering:
        manners.append((True, min(speed_ratio, PARTING_RATIO)))
    for parting, ratio in manners:
        for name, paths in ways_home(measured, home, opening):
            motion = Motion.of_paths(*paths, period, speed_ratio=ratio)
            refusal = arms.execute(motion, parting=parting, recovering=recovering)
            if refusal is None:
                return
            log.info("Way home %r: %s", name, refusal.reason)
            reasons.append(f"{name}: {refusal.reason}")
    if not recovering:
        arms.stop(f"the arms find no safe way home: {reasons[-1]}")
        if arms.fault is not None:
            raise FaultError(arms.fault)
    raise RecoveryError(
        "The arms find no safe way home; move them by hand with the cuff until they are clear of each other "
        f"and the table, then try again. Tried: {'; '.join(reasons)}."
    )


def ways_home(
    measured: FloatArray, home: FloatArray, opening: FloatArray
) -> Iterator[tuple[str, tuple[ArmPath, ArmPath]]]:
    """Yield named ways from `measured` to `home`, both [2, 7], the most careful or the quickest first."""
    risen, retreated = _risen(measured), _retreated(measured)
    up = _risen(retreated)
    direct, rising = [measured, home], [measured, risen, home]
    backing = [measured, retreated, up, home]
    # Something stands between low hands, as a rule: they leave it the way they came.
    named = [("straight", direct), ("up first", rising), ("back and up", backing)]
    for name, points in (
        reversed(named) if _low(measured) and np.abs(measured - home).max() > NEARLY else named
    ):
        left, right = (_path(arm, points, opening) for arm in (0, 1))
        yield name, (left, right)
    for name, points in (("up", rising), ("back and up", backing)):
        for first in (0, 1):
            moves = [_path(arm, points, opening) for arm in (0, 1)]
            second = 1 - first
            moves[second] = _wait(moves[second], moves[first].duration).then(moves[second])
            side = ("left", "right")[first]
            yield f"{name}, {side} arm first", (moves[0], moves[1])


def _path(arm: int, points: list[FloatArray], opening: FloatArray) -> ArmPath:
    kinematics, wide = sawyer_pair()[arm], opening[arm : arm + 1]
    path = ArmPath.stay(points[0][arm : arm + 1], wide)
    for before, after in zip(points[:-1], points[1:], strict=True):
        waypoints = np.stack([before[arm], after[arm]])[None]
        path = path.then(fastest_path(kinematics, waypoints, wide))
    return path


def _wait(path: ArmPath, seconds: FloatArray) -> ArmPath:
    """Return a path that stays where `path` starts for `seconds` [1]."""
    start = ArmPath.stay(path.joints[:, 0], path.opening[:, 0])
    return start.then(ArmPath(seconds[:, None], start.joints, start.velocities, start.opening))


def _risen(joints: FloatArray) -> FloatArray:
    """Return joint angles [2, 7] with low hands straight above where they are."""
    return _moved(joints, lambda position, rotation: np.array([0.0, 0.0, _missing_height(position)]))


def _retreated(joints: FloatArray) -> FloatArray:
    """Return joint angles [2, 7] with the hands backed off along their fingers."""
    return _moved(joints, lambda position, rotation: -RETREAT * rotation[:, 2])


def _low(joints: FloatArray) -> bool:
    """Return whether a hand is low."""
    heights = [arm.forward(row[None])[0][0, 2] for arm, row in zip(sawyer_pair(), joints, strict=True)]
    return bool(min(heights) < CLEAR_HEIGHT)


def _missing_height(position: FloatArray) -> float:
    return float(np.clip(CLEAR_HEIGHT - position[2], 0.0, RISE))


def _moved(joints: FloatArray, offset: Callable[[FloatArray, FloatArray], FloatArray]) -> FloatArray:
    """Return joint angles [2, 7] with each hand moved by `offset` of its position [3] and rotation [3, 3]."""
    rows = []
    for kinematics, row in zip(sawyer_pair(), joints, strict=True):
        position, rotation = kinematics.forward(row[None])
        target = position + offset(position[0], rotation[0])
        rows.append(solve_inverse(kinematics, target, rotation, row[None]).joints[0])
    return np.stack(rows)
