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
    took_at: list[float | None] = field(default_factory=lambda: [None, None])
    """Measured height at which each hand last closed, or pressed on something [m]; None: where it is now."""
    held: list[HeldObject | None] = field(default_factory=lambda: [None, None])
    """What each hand held when the last step was planned, in its own frame."""
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
        self._rises(states)  # hands that have just taken something are where they took it
        paths, goals = [], []
        for arm, skill in enumerate(self._skills(pair)):
            values = arguments[self._task.pairs.columns(arm, self._index(pair, arm))]
            paths.append(skill.plan(self._context(arm, states[arm], pose), values[None]))
            goals.append(hand_goal(skill, values, pose, arm, paths[arm].joints[0, 0]))
        held = self.hands.held = [self._held(arm, states[arm], pose) for arm in (0, 1)]
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
        skills = self._skills(pair)
        for arm, skill in enumerate(skills):
            if self._takes(arm, skill, motion.opening[arm]):
                self.hands.took_at[arm] = None
        self._arrived(motion)
        for arm, skill in enumerate(skills):
            if skill.ends_pressing is not None:
                self.hands.pressing[arm] = skill.ends_pressing

    def holds(self, states: tuple[ArmState, ArmState]) -> bool:
        """Return whether a hand has something between its fingers, or may press on something."""
        return any(self.hands.pressing[arm] or self._closed_on_something(arm, states[arm]) for arm in (0, 1))

    def is_up(self, states: tuple[ArmState, ArmState]) -> bool:
        """Return whether a hand is higher than where it took what it may hold."""
        return max(self._rises(states)) >= LEAST_DESCENT

    def put_down(
        self, states: tuple[ArmState, ArmState], speed_ratio: float, *, recovering: bool
    ) -> Motion | None:
        """Return the next motion that lowers hands to where they took what they hold; None: nothing is up.

        Hands that are up go down by the same distance at the same speed, as far as the lower one of them has
        to: what both hold stays level. They stay closed, and keep pressing; after a fault they start where
        they are and not where they were sent.
        """
        rises = self._rises(states)
        down = min((rise for rise in rises if rise >= LEAST_DESCENT), default=0.0)
        if down == 0.0:
            return None
        paths = [
            self._straight_down(
                arm, self._start(arm, states[arm], recovering), down if rises[arm] >= down else 0.0
            )
            for arm in (0, 1)
        ]
        held = [
            thing if self._closed_on_something(arm, states[arm]) else None
            for arm, thing in enumerate(self.hands.held)
        ]
        return Motion.of_paths(
            paths[0], paths[1], self._period, speed_ratio=speed_ratio, held=(held[0], held[1])
        )

    def lowered(self, motion: Motion) -> None:
        """Note that a motion of `put_down` was made."""
        self._arrived(motion)

    def _arrived(self, motion: Motion) -> None:
        self.hands.opening = motion.opening[:, -1].copy()
        self.hands.joints = motion.joints[:, -1].copy()

    def _takes(self, arm: int, skill: Skill, opening: FloatArray) -> bool:
        """Return whether a skill whose openings were [S] has its hand begin to hold something at its end.

        A hand that holds something already carries it to where it presses.
        """
        if is_closed(opening[-1]):
            carries = is_closed(opening.max()) and is_closed(self.hands.opening[arm])
            return not carries or (bool(skill.ends_pressing) and self.hands.held[arm] is None)
        return bool(skill.ends_pressing)

    def _rises(self, states: tuple[ArmState, ArmState]) -> list[float]:
        """Return how far each hand is above where it took what it may hold [m]; 0 if it holds nothing."""
        rises = []
        for arm, kinematics in enumerate(sawyer_pair()):
            height = float(kinematics.forward(states[arm].positions[None])[0][0, 2])
            holds = self.hands.pressing[arm] or is_closed(self.hands.opening[arm])
            took_at = self.hands.took_at[arm]
            if took_at is None or not holds:
                took_at = self.hands.took_at[arm] = height
            rises.append(height - took_at)
        return rises

    def _start(self, arm: int, state: ArmState, recovering: bool) -> FloatArray:
        """Return the joint angles [7] that an arm starts from."""
        return self.hands.joints[arm] if self.hands.pressing[arm] and not recovering else state.positions

    def _straight_down(self, arm: int, joints: FloatArray, distance: float) -> ArmPath:
        kinematics, start = sawyer_pair()[arm], joints[None].copy()
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
        joints = self._start(arm, state, recovering=False)
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
