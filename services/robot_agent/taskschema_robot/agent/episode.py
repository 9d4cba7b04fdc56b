"""One episode on the robot: reset, up to T steps through the gate, outcome, home."""

import dataclasses
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from taskschema.arrays import FloatArray
from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.policies import Actor
from taskschema.randomness import EpisodeKey, Purpose, generator
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import Motion
from taskschema.safety.refusal import Refusal
from taskschema.tasks.scene_task import SceneTask
from taskschema.trajectory import Trajectory
from taskschema_robot.agent.kept_files import step_name
from taskschema_robot.agent.observer import Observer, StateObserver
from taskschema_robot.agent.skill_step import StepPlanner
from taskschema_robot.agent.step_log import StepListener, StepRecord
from taskschema_robot.agent.world import EpisodeDroppedError, World
from taskschema_robot.clock import Clock
from taskschema_robot.reward.judge import Judgement, Outcome
from taskschema_robot.safety.fault import Fault, FaultError
from taskschema_robot.safety.gated_arms import GatedArms
from taskschema_robot.safety.homing import return_home

log = logging.getLogger("taskschema.robot")

MOST_DESCENTS = 4
"""Motions in which hands that are up by different heights are lowered: two, and two for what is left over."""

Preview = Callable[[Motion, Refusal | None, str], None]
"""Shown every plan before it is made; raises EpisodeDroppedError if a person does not want it."""
Release = Callable[[str], None]
"""Asks a person to take what the hands hold, with the reason; returns when they may open."""


@dataclass
class EpisodeRecord:
    """What an episode was, for logs and progress."""

    skills: list[tuple[str, str]] = field(default_factory=list)
    """Of each step that was begun, refused or not."""
    refusals: list[str] = field(default_factory=list)
    seconds: float = 0.0
    """From reset to home, on the robot's clock: a person's part in it included."""
    outcome: str = ""
    reason: str = ""
    evidence: str = ""
    """Name of the picture that the outcome was judged by; empty: none was kept."""


class EpisodeRunner:
    """Runs episodes on both arms.

    Args:
        task: whose episodes they are.
        size: [3] of the object [m].
        arms: behind the gate: nothing here can move them otherwise.
        world: the object.
        clock: the agent's.
        limits: the gate's.
        preview: told about every plan.
        release: asked before hands open that hold something in the air; None: nobody is there.
        observer: of what the policy sees; None: the state.
        listeners: told about every step.

    """

    def __init__(
        self,
        task: SceneTask,
        size: FloatArray,
        arms: GatedArms,
        world: World,
        clock: Clock,
        limits: SafetyLimits,
        preview: Preview | None = None,
        release: Release | None = None,
        observer: Observer | None = None,
        listeners: Sequence[StepListener] = (),
    ) -> None:
        self._task = task
        self._size = size
        self._arms = arms
        self._world = world
        self._clock = clock
        self._limits = limits
        self._preview = preview
        self._release = release
        self._listeners = tuple(listeners)
        self._observer = observer or StateObserver(task, size)
        self._lowering = False
        self._record, self._began = EpisodeRecord(), clock.now()
        self._planner = StepPlanner(task, size, limits.period, limits.speed_ratio)

    def run(self, key: EpisodeKey, policy: Actor) -> tuple[Trajectory, EpisodeRecord]:
        """Run the episode of a key and return what is streamed, and what happened.

        Raises:
            FaultError: if a fault stopped the arms: the episode does not count.
            EpisodeDroppedError: if its start or its outcome is unknown.

        """
        record = self._record = EpisodeRecord()
        self._began = self._clock.now()
        self._put_down(recovering=False)  # what an episode that a person dropped half-way still holds
        self.go_home()
        start = self._world.reset(self._task.draw_instance(generator(key, Purpose.RESET)))
        self._observer.begin()
        observations, pairs, raws = [], [], []
        judgement = Judgement(Outcome.FAILURE, "nothing has been done yet")
        for step in range(self._task.horizon):
            pose = self._pose()
            observation = self._observer.observe(self._arms.states(), pose, step)
            actions = policy.act(observation, step, [generator(key, Purpose.ACTION, step)])
            arguments = self._observer.skill_arguments(actions.arguments[0], pose)
            self._make((key, step), int(actions.pairs[0]), arguments, pose)
            observations.append(observation[0])
            pairs.append(int(actions.pairs[0]))
            raws.append(actions.raw[0])
            judgement = self._world.judge(start, step_name(key, step))
            if judgement.outcome is Outcome.SUCCESS:
                break
        judgement = self._end(start, judgement, step_name(key, "end"))
        if judgement.outcome is Outcome.UNKNOWN:
            raise EpisodeDroppedError(f"The outcome is unknown: {judgement.reason}.")
        record.seconds = self.so_far().seconds
        record.outcome, record.reason = str(judgement.outcome), judgement.reason
        record.evidence = judgement.picture
        trajectory = Trajectory(
            round=key.round,
            slot=key.slot,
            episode=key.episode,
            observations=np.stack(observations),
            pairs=np.array(pairs, dtype=np.int64),
            arguments=np.stack(raws),
            success=judgement.outcome is Outcome.SUCCESS,
            attempt=key.attempt,
            refused=len(record.refusals),
        )
        return trajectory, record

    def _end(self, start: FloatArray, judgement: Judgement, name: str) -> Judgement:
        """Put down what is held, go home, and return the outcome, which still may be unknown."""
        lifted = self._planner.is_up(self._arms.states())
        if lifted and judgement.outcome is Outcome.UNKNOWN:  # once it is put down, nobody can see it
            judgement = self._world.ask(judgement)
        self._put_down(recovering=False)
        self.go_home()
        if not lifted and judgement.outcome is Outcome.UNKNOWN:
            judgement = self._world.last_look(start, name)
        return judgement

    def abandon(self) -> None:
        """Put down what an episode that a person dropped half-way still holds, if no other one follows.

        Raises:
            FaultError: if a fault stops the arms; EpisodeDroppedError, if nobody lets them move.

        """
        if self._planner.is_up(self._arms.states()):
            self._put_down(recovering=False)
            self.go_home()

    def so_far(self) -> EpisodeRecord:
        """Return what the newest episode has been until now, its recovery included."""
        return dataclasses.replace(self._record, seconds=self._clock.now() - self._began)

    def recover(self) -> None:
        """After a fault that was acknowledged: put down what the hands still hold, then go home; slowly.

        Raises:
            FaultError: if another fault stops the arms; RecoveryError, if no way home is safe.

        """
        if self._lowering:
            self._let_go("a fault stopped the arms while they lowered it")
        else:
            self._put_down(recovering=True)
        self.go_home(recovering=True)

    def _put_down(self, *, recovering: bool) -> None:
        """Lower what is held before the hands open; what must not be lowered is a person's to take."""
        ratio = self._limits.recovery_speed_ratio if recovering else self._limits.speed_ratio
        for _ in range(MOST_DESCENTS):
            motion = self._planner.put_down(self._arms.states(), ratio, recovering=recovering)
            if motion is None:
                return
            refusal = self._lower(motion, recovering)
            if refusal is not None:
                self._let_go(refusal.reason)
                return
        if self._planner.is_up(self._arms.states()):
            self._let_go(f"the hands are not down after {MOST_DESCENTS} motions")

    def _lower(self, motion: Motion, recovering: bool) -> Refusal | None:
        """Make a motion that lowers the hands, and know afterwards whether a fault broke it off."""
        self._lowering = True
        try:
            refusal = self._arms.execute(motion, recovering=recovering)
        except EpisodeDroppedError:  # it was not begun
            self._lowering = False
            raise
        self._lowering = False
        if refusal is None:
            self._planner.lowered(motion)
        return refusal

    def _let_go(self, reason: str) -> None:
        """Have a person take what the hands hold up; they open after that."""
        self._lowering = False
        if not self._planner.holds(self._arms.states()):
            return
        log.warning("What is held is let go in the air: %s", reason)
        if self._release is not None:
            self._release(reason)

    def go_home(self, *, recovering: bool = False) -> None:
        """Open the hands and bring the arms home; slowly, along a checked way, after a fault."""
        limits = self._limits
        return_home(
            self._arms,
            self._task.home_joints,
            np.full(2, rethink_gripper().open),
            period=limits.period,
            speed_ratio=limits.recovery_speed_ratio if recovering else limits.speed_ratio,
            recovering=recovering,
        )
        self._planner.reset()

    def _make(
        self, place: tuple[EpisodeKey, int], pair: int, arguments: FloatArray, pose: FloatArray
    ) -> None:
        """Make one step, or note why it is refused: the arms stay then, and the step counts."""
        record, space = self._record, self._task.pairs
        names = space.pairs[pair]
        motion = self._planner.plan(pair, arguments, self._arms.states(), pose)
        if self._preview is not None:
            self._preview(motion, self._arms.check(motion), ", ".join(names))
        record.skills.append(names)
        step = StepRecord(*place, names, space.named(pair, arguments), pose, motion, self._clock.now())
        try:
            refusal = self._arms.execute(motion)
        except EpisodeDroppedError:
            record.skills.pop()  # it was not begun
            raise
        except FaultError as error:
            self._tell(step, fault=error.fault)
            raise
        self._tell(step, refusal=refusal)
        if refusal is not None:
            record.refusals.append(refusal.reason)
            return
        self._planner.done(pair, motion)

    def _tell(self, step: StepRecord, *, refusal: Refusal | None = None, fault: Fault | None = None) -> None:
        """Tell the listeners what came of a step."""
        seconds = self._clock.now() - step.began
        for listener in self._listeners:
            listener(dataclasses.replace(step, seconds=seconds, refusal=refusal, fault=fault))

    def _pose(self) -> FloatArray:
        pose = self._world.object_pose()
        if pose is None:
            raise EpisodeDroppedError("The object's place is unknown, and skills are planned from it.")
        return pose
