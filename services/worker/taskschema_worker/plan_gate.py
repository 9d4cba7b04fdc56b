"""The robot's checks before a motion, made on the plans of simulated episodes."""

from dataclasses import dataclass

import numpy as np

from taskschema.arrays import BoolArray, FloatArray, IntArray
from taskschema.kinematics.sawyer import GRIPPER_STROKE, rethink_gripper
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import HeldObject, Motion, set_point_times
from taskschema.safety.plan_checks import check_plan
from taskschema.safety.step_motion import hand_goal, held_object, is_closed, is_thick
from taskschema.safety.sweep import Sweep
from taskschema.tasks.scene_task import SceneTask
from taskschema_worker.mixed_path import MixedPath

SET_POINT_PERIOD = 0.02
"""Between the set-points that are checked [s]: 50 a second, as the robot's agent streams in training."""

ROBOT_OPENING = rethink_gripper().closed + GRIPPER_STROKE
"""Between the pads of the robot's open gripper [m]: the electric gripper's fingers travel less than the
simulated ones."""


@dataclass(frozen=True, eq=False)
class StepStart:
    """Where M episodes are when their steps begin."""

    joints: FloatArray
    """[M, 2, 7] measured [rad]."""
    set_points: FloatArray
    """[M, 2, 7] at the end of the last step [rad]."""
    opening: FloatArray
    """[M, 2] openings between the pads, as measured [m]."""
    told: FloatArray
    """[M, 2] openings that the grippers were last told [m]."""
    poses: FloatArray
    """[M, 7 + h] of the objects."""
    sizes: FloatArray
    """[M, 3] of the objects [m]."""


class PlanGate:
    """Says which steps the robot's gate would refuse.

    Args:
        task: whose skills they are.
        limits: of the gate.

    """

    def __init__(self, task: SceneTask, limits: SafetyLimits | None = None) -> None:
        self._task = task
        self._limits = limits or SafetyLimits(period=SET_POINT_PERIOD)
        self._sweep = Sweep(self._limits)

    def refused(
        self, start: StepStart, pairs: IntArray, arguments: FloatArray, paths: MixedPath
    ) -> BoolArray:
        """Return which of M episodes' steps, planned as `paths`, must not be made [M].

        Args:
            start: of the steps.
            pairs: [M] skill pairs.
            arguments: [M, A] SI units.
            paths: of the M left arms, then of the M right ones.

        """
        found = np.zeros(len(pairs), dtype=bool)
        for row, measured in enumerate(start.joints):
            motion = self.motion(row, start, int(pairs[row]), arguments[row], paths)
            refusal = check_plan(motion, measured, self._limits, start.set_points[row])
            found[row] = refusal is not None or self._sweep.refuses(motion, measured)
        return found

    def motion(
        self, row: int, start: StepStart, pair: int, arguments: FloatArray, paths: MixedPath
    ) -> Motion:
        """Return the set-points that the robot's agent would stream for one of the episodes.

        Args:
            row: of the episode among M.
            start: of all M steps.
            pair: the episode's.
            arguments: [A] the episode's.
            paths: of all 2 M arms.

        """
        arms = np.array([row, row + len(start.joints)])
        times = set_point_times(float(paths.duration[arms].max()), self._limits.period)
        joints, _, opening = paths.sample(times, arms)
        pose, space = start.poses[row], self._task.pairs
        goals, held = [], []
        for arm in (0, 1):
            index = int(space.skill_index(np.array(pair), arm))
            values = arguments[space.columns(arm, index)]
            goals.append(hand_goal(space.skills[index], values, pose, arm, joints[arm, 0]))
            held.append(self._held(row, arm, start))
        return Motion(joints, opening, self._limits.period, (goals[0], goals[1]), (held[0], held[1]))

    def _held(self, row: int, arm: int, start: StepStart) -> HeldObject | None:
        if not (is_closed(start.told[row, arm]) and is_thick(start.opening[row, arm])):
            return None
        return held_object(start.sizes[row], start.poses[row], arm, start.joints[row, arm])
