"""Every fault of the twin against the gate, over real sockets, on the twin's own clock.

Both arms are told to stop within 200 ms, nothing moves until the acknowledgement, then everything goes on.
"""

import numpy as np
import pytest
from motions import PERIOD, skill_motion, straight
from recording_arms import HOME
from twin_setup import LockStep

from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import Motion
from taskschema_robot.errors import NotConnectedError
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.safety.homing import return_home
from taskschema_robot.sawyer_interface import COLLISION_STATE, ENDPOINT_STATE
from taskschema_robot.twin.faults import FaultKind

STOP_SECONDS = 0.2
OPEN = np.full(2, rethink_gripper().open)


class FaultBench:
    """A gate on a twin; a fault comes in the middle of a motion."""

    def __init__(self) -> None:
        self.twin = LockStep()
        self.gate = SafetyGate(self.twin.arms, self.twin.clock, SafetyLimits())
        self.gate.prepare()

    def measured(self) -> np.ndarray:
        return np.stack([state.positions for state in self.gate.states()])

    def inject_during_motion(self, kind: FaultKind, arm: int | None, value: float = 0.0) -> float:
        """Start a slow swing, let the fault come after 0.3 s; return when it came."""
        clock, begin = self.twin.clock, self.twin.clock.now()
        sleep, moment = clock.sleep_until, []

        def sleep_until(until: float) -> None:
            sleep(until)
            if not moment and clock.now() > begin + 0.3:
                moment.append(clock.now())
                self.twin.client.inject(kind, arm, value=value)

        clock.sleep_until = sleep_until
        try:
            end = HOME.copy()
            end[:, 0] += 0.5
            self.gate.execute(straight(self.measured(), end, speed_ratio=0.4))
        finally:
            clock.sleep_until = sleep
        return moment[0]

    def close(self) -> None:
        self.twin.close()


@pytest.fixture
def bench():
    made = FaultBench()
    yield made
    made.close()


@pytest.mark.parametrize("arm", [0, 1])
@pytest.mark.parametrize(
    "kind",
    [
        FaultKind.DROP_CONNECTION,
        FaultKind.FREEZE_STATE,
        FaultKind.PRESS_EMERGENCY_STOP,
        FaultKind.JOINT_ERROR,
    ],
)
def test_a_fault_of_one_arm_stops_both_and_training_goes_on(bench, kind, arm):
    with pytest.raises(FaultError):
        bench.inject_during_motion(kind, arm)
    fault = bench.gate.fault
    stopped = bench.twin.clock.now()
    bench.twin.sleep(0.5)
    resting = [robot.control.reference.copy() for robot in bench.twin.running.twin.robots]
    with pytest.raises(FaultError):
        bench.gate.execute(straight(HOME, HOME))
    bench.twin.client.inject(kind, arm, active=False)
    bench.twin.sleep(1.0)
    for robot, before in zip(bench.twin.running.twin.robots, resting, strict=True):
        np.testing.assert_allclose(robot.control.reference, before, atol=1e-3)
    assert fault.time <= stopped
    bench.gate.acknowledge("tester")
    return_home(bench.gate, HOME, OPEN, period=PERIOD, speed_ratio=0.5, recovering=True)
    np.testing.assert_allclose(bench.measured(), HOME, atol=0.05)


def stop_time(bench: FaultBench, kind: FaultKind, arm: int | None) -> float:
    moment = None
    try:
        moment = bench.inject_during_motion(kind, arm)
    except FaultError as error:
        return error.fault.time
    raise AssertionError(f"{kind} went unnoticed; it came at {moment}")


@pytest.mark.parametrize(
    "kind", [FaultKind.DROP_CONNECTION, FaultKind.FREEZE_STATE, FaultKind.PRESS_EMERGENCY_STOP]
)
def test_both_arms_stop_within_200_ms(bench, kind):
    begin = bench.twin.clock.now()
    at = stop_time(bench, kind, 1)
    assert at - (begin + 0.3) <= STOP_SECONDS
    bench.twin.sleep(STOP_SECONDS)
    speed = [np.abs(robot.control.velocity).max() for robot in bench.twin.running.twin.robots]
    alive = speed[:1] if kind is FaultKind.DROP_CONNECTION else speed
    assert max(alive) < 0.02


@pytest.mark.parametrize(
    ("kind", "topic", "longest"),
    [
        (FaultKind.SILENCE_WRENCH, ENDPOINT_STATE, STOP_SECONDS),
        (FaultKind.SILENCE_COLLISION, COLLISION_STATE, 0.7),
    ],
)
def test_a_silent_topic_stops_both_arms_and_no_arm_begins_with_one(bench, kind, topic, longest):
    begin = bench.twin.clock.now()
    at = stop_time(bench, kind, 1)
    assert at - (begin + 0.3) <= longest
    assert topic in bench.gate.fault.reason
    bench.twin.arms[1].close()
    with pytest.raises(NotConnectedError, match=f"nothing comes from {topic}:"):
        bench.gate.acknowledge("tester")
    bench.twin.client.inject(kind, 1, active=False)
    bench.gate.acknowledge("tester")
    return_home(bench.gate, HOME, OPEN, period=PERIOD, speed_ratio=0.5, recovering=True)


def test_a_skewed_clock_stops_nothing(bench):
    bench.inject_during_motion(FaultKind.SKEW_CLOCK, 0, value=30.0)
    assert bench.gate.fault is None


def grip(bench: FaultBench) -> Motion:
    joints = np.repeat(bench.measured()[:, None], 3, axis=1)
    return Motion(joints, np.full((2, 3), rethink_gripper().closed), PERIOD)


@pytest.mark.parametrize("kind", [FaultKind.LOSE_ACKNOWLEDGEMENT, FaultKind.STICK_GRIPPER])
def test_a_gripper_that_does_not_do_or_say_what_it_should(bench, kind):
    bench.twin.client.inject(kind, 0)
    with pytest.raises(FaultError, match="left gripper"):
        bench.gate.execute(grip(bench))


def test_a_persons_arm_in_the_way(bench):
    bench.twin.client.inject(FaultKind.OBSTACLE)
    reach = skill_motion(bench.measured(), ("top_grasp", "no_op"), ([0.0, 0.0, 2.4], []), speed_ratio=0.5)
    with pytest.raises(FaultError):
        bench.gate.execute(reach)
    assert bench.gate.fault.kind in ("collision", "wrench", "tracking", "stopped", "arrival", "robot_error")
