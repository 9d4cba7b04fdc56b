"""Every fault of the twin against the gate, over real sockets, on the twin's own clock.

Both arms are told to stop within 200 ms of when a fault shows and rest soon after, nothing moves until the
acknowledgement, then everything goes on. The seconds measured are printed (`-s`).
"""

import math

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
from taskschema_robot.safety.monitors import CameraMonitor
from taskschema_robot.sawyer_interface import COLLISION_STATE, ENDPOINT_STATE
from taskschema_robot.twin.camera import LockStepCamera
from taskschema_robot.twin.faults import FaultKind

STOP_SECONDS = 0.2
"""Within which both arms are told to stop, once a fault shows in what the agent receives [s]."""
REST_SECONDS = 0.2
"""Within which they rest after that [s]: 0.09 at most was measured, at up to 0.7 rad/s."""
STALL_TRAVEL = 0.005
"""After a stall what was on its way arrives [rad]: set-points of 0.1 s, the stop right behind them."""
AT_REST = 0.02
"""No joint is faster [rad/s]."""
OPEN = np.full(2, rethink_gripper().open)


class FaultBench:
    """A gate on a twin; a fault comes in the middle of a motion."""

    def __init__(self) -> None:
        self.twin = LockStep()
        camera = LockStepCamera(self.twin.client, self.twin.clock)
        monitor = CameraMonitor(camera, SafetyLimits().camera_age)
        self.gate = SafetyGate(self.twin.arms, self.twin.clock, SafetyLimits(), [monitor])
        self.injected = math.inf
        """When the fault came [s]."""
        self.gate.prepare()

    def measured(self) -> np.ndarray:
        return np.stack([state.positions for state in self.gate.states()])

    def inject_during_motion(
        self, kind: FaultKind, arm: int | None, value: float = 0.0, speed_ratio: float = 0.4
    ) -> None:
        """Start a slow swing, let the fault come after 0.3 s."""
        clock, begin = self.twin.clock, self.twin.clock.now()
        sleep = clock.sleep_until

        def sleep_until(until: float) -> None:
            sleep(until)
            if self.injected == math.inf and clock.now() > begin + 0.3:
                self.injected = clock.now()
                self.twin.client.inject(kind, arm, value=value)

        clock.sleep_until = sleep_until
        try:
            end = HOME.copy()
            end[:, 0] += 0.5
            self.gate.execute(straight(self.measured(), end, speed_ratio=speed_ratio))
        finally:
            clock.sleep_until = sleep

    def seconds_to_rest(self) -> float:
        """Let time pass until no joint of either arm moves; return how long that took [s]."""
        begin = self.twin.clock.now()
        while max(np.abs(robot.control.velocity).max() for robot in self.twin.running.twin.robots) > AT_REST:
            self.twin.sleep(0.01)
            assert self.twin.clock.now() < begin + 5.0, "it does not stop"
        return self.twin.clock.now() - begin

    def acknowledge_and_go_on(self) -> None:
        """Acknowledge; go home slowly; make another motion."""
        self.gate.acknowledge("tester")
        return_home(self.gate, HOME, OPEN, period=PERIOD, speed_ratio=0.5, recovering=True)
        np.testing.assert_allclose(self.measured(), HOME, atol=0.05)
        assert self.gate.execute(straight(self.measured(), HOME + 0.02)) is None

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
        FaultKind.STALL_CONNECTION,
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
    nudge = STALL_TRAVEL if kind is FaultKind.STALL_CONNECTION else 1e-3
    for robot, before in zip(bench.twin.running.twin.robots, resting, strict=True):
        np.testing.assert_allclose(robot.control.reference, before, atol=nudge)
    assert fault.time <= stopped
    bench.gate.acknowledge("tester")
    return_home(bench.gate, HOME, OPEN, period=PERIOD, speed_ratio=0.5, recovering=True)
    np.testing.assert_allclose(bench.measured(), HOME, atol=0.05)


def stop_time(bench: FaultBench, kind: FaultKind, arm: int | None, speed_ratio: float = 0.4) -> float:
    """Return how long after the fault came both arms had been told to stop [s]."""
    with pytest.raises(FaultError) as error:
        bench.inject_during_motion(kind, arm, speed_ratio=speed_ratio)
    return error.value.fault.time - bench.injected


@pytest.mark.parametrize(
    "kind",
    [
        FaultKind.DROP_CONNECTION,
        FaultKind.STALL_CONNECTION,
        FaultKind.FREEZE_STATE,
        FaultKind.PRESS_EMERGENCY_STOP,
        FaultKind.JOINT_ERROR,
    ],
)
def test_both_arms_stop_within_200_ms(bench, kind):
    told, rest = stop_time(bench, kind, 1), bench.seconds_to_rest()
    print(f"{kind}: told after {told:.3f} s, at rest {rest:.3f} s later")
    assert told <= STOP_SECONDS
    assert rest <= REST_SECONDS


@pytest.mark.parametrize("kind", [FaultKind.FREEZE_CAMERA, FaultKind.REPEAT_PICTURE])
def test_a_camera_that_stands_still_stops_both_arms(bench, kind):
    told, rest = stop_time(bench, kind, None, speed_ratio=0.15), bench.seconds_to_rest()
    print(f"{kind}: told after {told:.3f} s, at rest {rest:.3f} s later")
    assert bench.gate.fault.kind == "camera"
    assert told <= SafetyLimits().camera_age + STOP_SECONDS
    assert rest <= REST_SECONDS
    bench.twin.client.inject(kind, active=False)
    bench.twin.sleep(0.1)
    bench.acknowledge_and_go_on()


@pytest.mark.parametrize(
    ("kind", "topic", "longest"),
    [
        (FaultKind.SILENCE_WRENCH, ENDPOINT_STATE, STOP_SECONDS),
        (FaultKind.SILENCE_COLLISION, COLLISION_STATE, 0.7),
    ],
)
def test_a_silent_topic_stops_both_arms_and_no_arm_begins_with_one(bench, kind, topic, longest):
    assert stop_time(bench, kind, 1) <= longest
    assert bench.seconds_to_rest() <= REST_SECONDS
    assert topic in bench.gate.fault.reason
    bench.twin.arms[1].close()
    with pytest.raises(NotConnectedError, match=f"nothing comes from {topic}:"):
        bench.gate.acknowledge("tester")
    bench.twin.client.inject(kind, 1, active=False)
    bench.acknowledge_and_go_on()


def test_a_skewed_clock_stops_nothing(bench):
    bench.inject_during_motion(FaultKind.SKEW_CLOCK, 0, value=30.0)
    assert bench.gate.fault is None


def grip(bench: FaultBench) -> Motion:
    joints = np.repeat(bench.measured()[:, None], 3, axis=1)
    return Motion(joints, np.full((2, 3), rethink_gripper().closed), PERIOD)


@pytest.mark.parametrize("kind", [FaultKind.LOSE_ACKNOWLEDGEMENT, FaultKind.STICK_GRIPPER])
def test_a_gripper_that_does_not_do_or_say_what_it_should(bench, kind):
    """The arms rest already: a hand has its two seconds after the last set-point."""
    bench.twin.client.inject(kind, 0)
    motion, begin = grip(bench), bench.twin.clock.now()
    with pytest.raises(FaultError, match="left gripper") as error:
        bench.gate.execute(motion)
    limits = SafetyLimits()
    assert error.value.fault.time - begin <= motion.duration + limits.arrival_seconds + STOP_SECONDS
    assert bench.seconds_to_rest() == 0.0
    bench.twin.client.inject(kind, 0, active=False)
    bench.acknowledge_and_go_on()
    assert bench.gate.execute(grip(bench)) is None


def test_a_persons_arm_in_the_way(bench):
    bench.twin.client.inject(FaultKind.OBSTACLE)
    touched: list[float] = []
    clock, sleep = bench.twin.clock, bench.twin.clock.sleep_until

    def sleep_until(moment: float) -> None:
        sleep(moment)
        if not touched and any(robot.node.collision for robot in bench.twin.running.twin.robots):
            touched.append(clock.now())

    clock.sleep_until = sleep_until
    reach = skill_motion(bench.measured(), ("top_grasp", "no_op"), ([0.0, 0.0, 2.4], []), speed_ratio=0.5)
    with pytest.raises(FaultError) as error:
        bench.gate.execute(reach)
    told, rest = error.value.fault.time - touched[0], bench.seconds_to_rest()
    print(f"obstacle: told {told:.3f} s after the robot felt it, at rest {rest:.3f} s later")
    assert error.value.fault.kind == "collision"
    assert told <= STOP_SECONDS
    assert rest <= REST_SECONDS
    bench.twin.client.inject(FaultKind.OBSTACLE, active=False)
    bench.twin.sleep(1.0)
    bench.acknowledge_and_go_on()
