"""What hands hold in the air is put down: after an episode, and after a fault that was acknowledged."""

import numpy as np
import pytest
from hands_in_the_air import TOOK_AT, InTheAir, raised
from recording_arms import TestBench
from scripted_expert import TASK, Expert
from studies import twin_expert
from twin_setup import LockStep

from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.step_motion import held_object
from taskschema.tasks import get_task
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.skill_step import StepPlanner
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.objects.catalogue import HEAVY_BAR, SOCCER_BALL
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.twin.faults import FaultKind

CARRIED = 0.12
"""Height of the bar at which the fault comes [m]."""
FALLING = 0.4
"""[m/s] downwards: what is let go is faster within 41 ms; hands lower at most 0.15 m/s."""
PICKING = get_task("picking")


class Carrying:
    """An episode on a twin that a fault breaks off while the bar is in the air."""

    def __init__(self, limits: SafetyLimits) -> None:
        self.twin = LockStep(HEAVY_BAR)
        self.gate = SafetyGate(self.twin.arms, self.twin.clock, limits)
        self.gate.prepare()
        world = TrueWorld(self.twin.client, TASK, HEAVY_BAR, self.twin.clock)
        self.released: list[str] = []
        self.runner = EpisodeRunner(
            TASK,
            np.array(HEAVY_BAR.size),
            self.gate,
            world,
            self.twin.clock,
            limits,
            release=self.released.append,
        )
        self.heights: list[float] = []
        self.faults: list[FaultKind] = []
        self._sleep = self.twin.clock.sleep_until
        self.twin.clock.sleep_until = self._watch

    def _watch(self, moment: float) -> None:
        self._sleep(moment)
        self.heights.append(float(self.twin.running.twin.world.object_pose[2]))
        if self.faults and self.heights[-1] > CARRIED:
            self.twin.client.inject(self.faults.pop(), 1)

    def break_off(self, *faults: FaultKind) -> None:
        self.faults = list(reversed(faults))
        with pytest.raises(FaultError):
            self.runner.run(EpisodeKey(0, 0, 0, 0), Expert(0.35))

    def rest(self, seconds: float) -> None:
        clock = self.twin.clock
        end = clock.now() + seconds
        while clock.now() < end:
            clock.sleep_until(clock.now() + 0.02)

    def acknowledge(self) -> None:
        self.twin.client.inject(FaultKind.PRESS_EMERGENCY_STOP, 1, active=False)
        self.rest(0.2)
        self.gate.acknowledge("tester")


@pytest.fixture
def carrying():
    made = Carrying(SafetyLimits(period=0.02, recovery_speed_ratio=0.4))
    yield made
    made.twin.close()


def test_hands_keep_the_bar_until_it_is_put_down(carrying):
    carrying.break_off(FaultKind.PRESS_EMERGENCY_STOP)
    stopped = carrying.heights[-1]
    carrying.rest(3.0)
    assert carrying.heights[-1] == pytest.approx(stopped, abs=0.02), "nothing moves before the word"
    carrying.acknowledge()
    begin = len(carrying.heights)
    carrying.runner.recover()
    heights = np.array(carrying.heights[begin:])
    assert heights[-1] < 0.05
    assert np.diff(heights).min() / 0.02 > -FALLING, "it fell"
    measured = np.stack([state.positions for state in carrying.gate.states()])
    np.testing.assert_allclose(measured, TASK.home_joints, atol=0.05)
    openings = [state.gripper.opening for state in carrying.gate.states()]
    assert min(openings) > rethink_gripper().closed + 0.03
    assert not carrying.released


def test_a_fault_while_it_is_put_down_has_a_person_take_it(carrying):
    carrying.break_off(FaultKind.PRESS_EMERGENCY_STOP)
    carrying.acknowledge()
    carrying.faults = [FaultKind.PRESS_EMERGENCY_STOP]
    with pytest.raises(FaultError):
        carrying.runner.recover()
    assert not carrying.released
    carrying.acknowledge()
    carrying.runner.recover()
    assert carrying.released == ["a fault stopped the arms while they lowered it"]


@pytest.mark.parametrize(
    ("at", "closed"),
    [
        ((0.4, 0.05), (True, True)),
        ((0.4, 0.1), (True, True)),
        ((0.4, 0.4), (True, True)),
        ((0.4, 0.4), (True, False)),
        ((0.25, 0.3), (False, False)),
    ],
)
def test_each_hand_goes_down_to_where_it_took_what_it_holds(at, closed):
    in_the_air = InTheAir(*at, closed=closed)
    np.testing.assert_allclose(in_the_air.put_down(), TOOK_AT, atol=0.01)
    assert not in_the_air.released


def test_open_hands_that_press_on_nothing_are_left_where_they_are():
    in_the_air = InTheAir(0.3, 0.3, closed=(False, False))
    in_the_air.runner._planner.hands.pressing = [False, False]
    np.testing.assert_allclose(in_the_air.put_down(), 0.3, atol=0.001)


def test_what_does_not_come_down_is_a_persons_to_take():
    in_the_air = InTheAir(0.4, 0.4, closed=(True, False))
    for arm in in_the_air.bench.arms:
        arm.follows = False
    in_the_air.runner._lower = lambda motion, recovering: None  # made, they say
    in_the_air.put_down()
    assert in_the_air.released == ["the hands are not down after 4 motions"]


def test_what_is_lowered_is_swept(monkeypatch):
    in_the_air = InTheAir(0.3, 0.3)
    planner, states = in_the_air.runner._planner, in_the_air.bench.gate.states()
    pose = np.array([0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0])
    planner.hands.held = [held_object(np.array(HEAVY_BAR.size), pose, 0, states[0].positions), None]
    monkeypatch.setattr(planner, "_closed_on_something", lambda arm, state: True)
    motion = planner.put_down(states, 1.0, recovering=False)
    assert motion.held == tuple(planner.hands.held)


@pytest.mark.parametrize(
    ("before", "pair", "took"),
    [
        ("open", ("go_to_pose", "go_to_pose"), True),
        ("holding", ("go_to_pose", "go_to_pose"), False),
        ("empty", ("go_to_pose", "go_to_pose"), True),
        ("holding", ("top_grasp", "top_grasp"), True),
        ("holding", ("lift", "lift"), False),
    ],
)
def test_hands_take_where_they_close_or_press(before, pair, took):
    planner, at = StepPlanner(PICKING, np.array(SOCCER_BALL.size), 0.01, 1.0), raised(0.3, 0.3)
    states = TestBench(at).gate.states()
    planner.hands.took_at, planner.hands.joints = [TOOK_AT, TOOK_AT], at
    if before != "open":
        planner.hands.opening = np.full(2, rethink_gripper().closed)
    arguments = np.zeros(PICKING.pairs.argument_count)
    pose = np.array([0.0, 0.0, 0.075, 1.0, 0.0, 0.0, 0.0])
    index = PICKING.pairs.index(*pair)
    motion = planner.plan(index, arguments, states, pose)
    planner.hands.held = [None, None] if before == "empty" else ["it", "it"]
    planner.done(index, motion)
    assert planner.hands.took_at == ([None, None] if took else [TOOK_AT, TOOK_AT])


def test_a_hand_held_back_where_it_presses_is_not_up():
    planner = StepPlanner(PICKING, np.array(SOCCER_BALL.size), 0.01, 1.0)
    planner.hands.joints, planner.hands.pressing = raised(0.27, 0.27), [True, True]
    assert not planner.is_up(TestBench(raised(0.3, 0.3)).gate.states())
    assert planner.is_up(TestBench(raised(0.3, 0.35)).gate.states())


def test_a_ball_between_a_closed_hand_and_one_that_presses_is_put_down():
    twin, falls = LockStep(SOCCER_BALL), []
    try:
        limits = SafetyLimits(period=0.02)
        gate = SafetyGate(twin.arms, twin.clock, limits)
        gate.prepare()
        world = TrueWorld(twin.client, PICKING, SOCCER_BALL, twin.clock)
        runner = EpisodeRunner(PICKING, np.array(SOCCER_BALL.size), gate, world, twin.clock, limits)
        expert = twin_expert.Expert(PICKING, twin_expert.RECIPES["soccer-ball"])
        home = runner.go_home

        def before_home(**kwargs) -> None:
            falls.append(twin.client.object_pose()[2])
            home(**kwargs)

        runner.go_home = before_home
        trajectory, _ = runner.run(EpisodeKey(0, 0, 0, 0), expert)
    finally:
        twin.close()
    assert trajectory.success
    assert falls[-1] < 0.1, "it is let go in the air"
