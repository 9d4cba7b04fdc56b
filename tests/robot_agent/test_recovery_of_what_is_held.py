"""A fault while both hands carry the bar: they keep it, and put it down once a person has acknowledged."""

import numpy as np
import pytest
from scripted_expert import TASK, Expert
from twin_setup import LockStep

from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.twin_world import TrueWorld
from taskschema_robot.objects.catalogue import HEAVY_BAR
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.twin.faults import FaultKind

CARRIED = 0.12
"""Height of the bar at which the fault comes [m]."""
FALLING = 0.4
"""[m/s] downwards: what is let go is faster within 41 ms; hands lower at most 0.15 m/s."""


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
