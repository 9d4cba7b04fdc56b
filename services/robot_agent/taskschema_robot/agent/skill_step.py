"""One step on the robot: the skills' own plans, as a motion for the gate."""

from dataclasses import dataclass, field

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.inverse import solve_inverse
from taskschema.kinematics.sawyer import rethink_gripper, sawyer_pair, sawyers
from taskschema.motion import ArmPath, PlanningContext
from taskschema.motion.line import joints_along_line
from taskschema.motion.timing import PathLimits, fastest_path
from taskschema.safety.motion import HeldObject, Motion
from taskschema.safety.step_motion import hand_goal, held_object, is_closed, is_thick
from taskschema.skills.skill import Skill
from taskschema.tasks.scene_task import SceneTask
from taskschema_robot.drivers.driver import ArmState

LEAST_DESCENT = 0.01
"""What is lifted by less is let go where it is [m]."""
DESCENT_POSES = 6
DESCENT = PathLimits(speed=0.15, acceleration=0.5)
"""Of what is put down [m/s], [m/s^2]."""


@dataclass
class HandState:
    """What an arm was last told: a skill starts from there where the arm may be pressing."""

    opening: FloatArray = field(default_factory=lambda: np.full(2, rethink_gripper().open))
    """[2] gripper set-points [m]."""
    joints: FloatArray = field(default_factory=lambda: np.zeros((2, 7)))
    """[2, 7] set-points at the end of the last step [rad]."""
    closed_at: list[float] = field(default_factory=lambda: [0.0, 0.0])
    """Height at which each hand last closed [m]."""
    pressing: list[bool] = field(default_factory=lambda: [False, False])
    """Whether an arm may have ended its last skill pressing on something."""


class StepPlanner:
    """Plans both arms' skills with the very code that simulation runs.

    Args:
        task: whose skills they are.
        size: [3] of the object [m].
        period: of the set-points [s].
        speed_ratio: of the motions.

    """

    def __init__(self, task: SceneTask, size: FloatArray, period: float, speed_ratio: float) -> None:
        self._task = task
        self._size = size
        self._period = period
        self._speed_ratio = speed_ratio
        self.hands = HandState()

    def reset(self) -> None:
        """A new episode: hands open, arms where they are."""
        self.hands = HandState()

    def plan(
        self, pair: int, arguments: FloatArray, states: tuple[ArmState, ArmState], pose: FloatArray
    ) -> Motion:
        """Return the motion of a pair with SI arguments [A], the object being at `pose` [7 + h]."""
        paths, goals = [], []
        for arm, skill in enumerate(self._skills(pair)):
            values = arguments[self._task.pairs.columns(arm, self._index(pair, arm))]
            paths.append(skill.plan(self._context(arm, states[arm], pose), values[None]))
            goals.append(hand_goal(skill, values, pose))
        held = [self._held(arm, states[arm], pose) for arm in (0, 1)]
        return Motion.of_paths(
            paths[0],
            paths[1],
            self._period,
            speed_ratio=self._speed_ratio,
            goals=(goals[0], goals[1]),
            held=(held[0], held[1]),
        )

    def done(self, pair: int, motion: Motion) -> None:
        """Note what a motion that was made leaves behind."""
        for arm, kinematics in enumerate(sawyer_pair()):
            if motion.opening[arm, -1] < self.hands.opening[arm]:
                position, _ = kinematics.forward(motion.joints[arm, -1:])
                self.hands.closed_at[arm] = float(position[0, 2])
        self.hands.opening = motion.opening[:, -1].copy()
        self.hands.joints = motion.joints[:, -1].copy()
        for arm, skill in enumerate(self._skills(pair)):
            if skill.ends_pressing is not None:
                self.hands.pressing[arm] = skill.ends_pressing

    def holds(self, states: tuple[ArmState, ArmState]) -> bool:
        """Return whether a hand that was closed has something between its fingers."""
        return any(self._closed_on_something(arm, states[arm]) for arm in (0, 1))

    def put_down(self, states: tuple[ArmState, ArmState], speed_ratio: float) -> Motion | None:
        """Return the motion that lowers what closed hands lifted to where they took it; None: nothing is up.

        Both hands go down by the same distance at the same speed: what they hold stays level. They stay
        closed.
        """
        closed = [arm for arm in (0, 1) if is_closed(self.hands.opening[arm])]
        heights = [
            float(kinematics.forward(state.positions[None])[0][0, 2])
            for kinematics, state in zip(sawyer_pair(), states, strict=True)
        ]
        down = min((heights[arm] - self.hands.closed_at[arm] for arm in closed), default=0.0)
        if down < LEAST_DESCENT:
            return None
        paths = [self._straight_down(arm, states[arm], down if arm in closed else 0.0) for arm in (0, 1)]
        return Motion.of_paths(paths[0], paths[1], self._period, speed_ratio=speed_ratio)

    def _straight_down(self, arm: int, state: ArmState, distance: float) -> ArmPath:
        kinematics, start = sawyer_pair()[arm], state.positions[None].copy()
        opening = self.hands.opening[arm : arm + 1]
        if distance == 0.0:
            return ArmPath.stay(start, opening)
        position, rotation = kinematics.forward(start)
        target = position - np.array([0.0, 0.0, distance])
        end = solve_inverse(kinematics, target, rotation, start).joints
        points = joints_along_line(kinematics, (start, end), (position, target), rotation, DESCENT_POSES)
        lengths = np.full((1, DESCENT_POSES - 1), distance / (DESCENT_POSES - 1))
        return fastest_path(kinematics, points, opening, lengths=lengths, limits=DESCENT)

    def _index(self, pair: int, arm: int) -> int:
        return int(self._task.pairs.skill_index(np.array(pair), arm))

    def _skills(self, pair: int) -> list[Skill]:
        return [self._task.pairs.skills[self._index(pair, arm)] for arm in (0, 1)]

    def _context(self, arm: int, state: ArmState, pose: FloatArray) -> PlanningContext:
        joints = self.hands.joints[arm] if self.hands.pressing[arm] else state.positions
        height = self._size[2:]
        return PlanningContext(
            arm=sawyers(np.array([arm])),
            gripper=rethink_gripper(),
            joints=joints[None].copy(),
            opening=self.hands.opening[arm : arm + 1],
            object_position=pose[None, :3],
            object_quaternion=pose[None, 3:7],
            object_size=self._size[None],
            top_grasp_offset=self._task.top_grasp_height * height,
            side_grasp_offset=self._task.side_grasp_height * height,
            lift_speed=self._task.lift_speed,
        )

    def _closed_on_something(self, arm: int, state: ArmState) -> bool:
        holds = is_thick(state.gripper.opening) or state.gripper.gripping
        return is_closed(self.hands.opening[arm]) and holds

    def _held(self, arm: int, state: ArmState, pose: FloatArray) -> HeldObject | None:
        """Return the object in the hand's frame, if the hand holds it."""
        if not self._closed_on_something(arm, state):
            return None
        return held_object(self._size, pose, arm, state.positions)
