"""Hold-to-run: what counts as held, what waits for it, and the whole agent at a terminal."""

import dataclasses
import threading
import time

import numpy as np
import pytest
from agent_setup import CONFIG, TASK
from bus_setup import Run
from motions import straight
from person_at_terminal import PATIENT, PersonAtTerminal
from recording_arms import HOME, TestBench

from taskschema.bus.learner_life import LearnerLife
from taskschema.kinematics.sawyer import rethink_gripper
from taskschema.policies import PolicySnapshot
from taskschema.safety.limits import SafetyLimits
from taskschema.safety.motion import Motion
from taskschema_learner.learner import Learner
from taskschema_robot.agent.attended_arms import AttendedArms
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.world import EpisodeDroppedError
from taskschema_robot.safety.fault import Fault, FaultError, FaultKind
from taskschema_robot.safety.hold_to_run import HoldToRun


def pressed(held: HoldToRun, now: list[float], *gaps: float) -> HoldToRun:
    for gap in gaps:
        now[0] += gap
        assert held.take("h")
    return held


@pytest.mark.parametrize(
    ("gaps", "silence", "expected"),
    [
        ((0.0,), 0.0, False),  # one press may be let go at once
        ((0.0, 0.5), 0.1, True),
        ((0.0, 0.5, 0.03, 0.03), 0.45, False),  # let go
        ((0.0, 1.0), 0.0, False),  # two presses, no repeat
    ],
)
def test_held_is_what_keeps_coming(gaps, silence, expected):
    now = [10.0]
    held = pressed(HoldToRun(lambda: now[0]), now, *gaps)
    now[0] += silence
    assert held.held is expected
    fault = held.fault(0.0)
    assert (fault is None) is expected
    assert expected or fault.kind is FaultKind.REQUESTED


@pytest.mark.parametrize("key", "pudqyn\nx")
def test_keys_with_a_meaning_are_not_the_one_to_hold(key):
    held = HoldToRun(lambda: 0.0)
    assert not any(held.take(key) for _ in range(5))
    assert not held.held


class Attended:
    """Arms that need a key, which a person holds down some time after they are asked."""

    guards_recovery = True

    def __init__(self, after: float = 0.05, patience: float = 5.0) -> None:
        self.asked = 0
        self.held = False
        self.bench = TestBench(monitors=[self])
        self._after = after
        self.arms = AttendedArms(self.bench.gate, lambda: self.held, self._ask, patience)

    def fault(self, now: float) -> Fault | None:
        return None if self.held else Fault(FaultKind.REQUESTED, "not held", now)

    def _ask(self) -> None:
        self.asked += 1
        assert not self.bench.sent, "it moved before"
        threading.Timer(self._after, lambda: setattr(self, "held", True)).start()


def test_a_motion_waits_for_the_key_without_a_fault():
    attended = Attended()
    assert attended.arms.execute(straight(HOME, HOME + 0.01)) is None
    assert attended.asked == 1
    assert attended.bench.sent
    assert attended.bench.faults == []


def test_what_is_refused_needs_no_key():
    attended = Attended()
    assert attended.arms.execute(straight(HOME + 0.5, HOME)) is not None
    assert attended.asked == 0
    assert attended.bench.faults == []


def test_nobody_there_drops_the_episode_and_latches_nothing():
    attended = Attended(after=60.0, patience=0.1)
    with pytest.raises(EpisodeDroppedError, match="hold-to-run key within"):
        attended.arms.execute(straight(HOME, HOME + 0.01))
    assert attended.bench.faults == []
    assert attended.bench.sent == 0


def test_a_stop_ends_the_waiting():
    attended = Attended(after=60.0, patience=60.0)
    threading.Timer(0.1, lambda: attended.arms.stop("the stop key")).start()
    with pytest.raises(FaultError, match="the stop key"):
        attended.arms.execute(straight(HOME, HOME + 0.01))


def test_what_a_dropped_episode_holds_is_put_down_before_the_next_one_begins():
    """A person says no to the last plan while both hands carry the bar: they must not open in the air."""
    bench = TestBench()
    runner = EpisodeRunner(TASK, np.ones(3), bench.gate, None, bench.clock, SafetyLimits())
    closed = np.full(2, rethink_gripper().closed)
    bench.gate.execute(Motion(np.repeat(HOME[:, None], 2, axis=1), np.repeat(closed[:, None], 2, 1), 0.01))
    runner._planner.hands.opening = closed
    runner._planner.hands.took_at = [0.1, 0.1]
    opened: list[float] = []
    set_gripper = bench.arms[0].set_gripper

    def note(opening: float) -> None:
        if opening > rethink_gripper().closed:
            opened.append(float(_height(bench)))
        set_gripper(opening)

    bench.arms[0].set_gripper = note
    with pytest.raises(AttributeError):  # there is no world to go on in
        runner.run(None, None)
    assert opened[0] == pytest.approx(0.1, abs=0.01)


def _height(bench: TestBench) -> float:
    from taskschema.kinematics.sawyer import sawyer_pair

    return sawyer_pair()[0].forward(bench.positions()[:1])[0][0, 2]


class PersonAtRun(PersonAtTerminal):
    """Goes on with every plan and holds the key; once, in the middle, presses the stop key with it."""

    def __init__(self, command: list[str]) -> None:
        self.stop_once = True
        super().__init__(command, {"Enter to go on": "\n", "Your name, to acknowledge: ": "Ada\n"})

    def while_holding(self) -> bytes:
        if self.stop_once and len(self.asked) > 3:
            self.stop_once = False
            return b"h "
        return b""


def lifting(snapshot: PolicySnapshot) -> PolicySnapshot:
    """Return a policy whose every step raises both open hands: nothing is in the way up there."""
    pair = TASK.pairs.pairs.index(("lift", "lift"))
    logits = np.full_like(snapshot.logits, -50.0)
    logits[:, pair] = 50.0
    return dataclasses.replace(snapshot, logits=logits)


@pytest.mark.slow  # a held key must keep coming, on a machine with nothing else to do
@pytest.mark.timeout(900)
def test_preview_and_hold_to_run_together_at_a_terminal(shared_redis, tmp_path):
    """Plans are looked at, the key is held, the arms move; a stop, its acknowledgement, the way home."""
    with Run(shared_redis.url, CONFIG) as run:
        learner = run.learner()
        learner.open_round(0, lifting(Learner(CONFIG, TASK).snapshot()), range(CONFIG.slots))
        command = [*PATIENT, "run"]
        command += [run.name, "--object", "heavy-bar", "--redis", run.url, "--twin", "own"]
        command += ["--see", "truth"]
        command += ["--folder", str(tmp_path), "--stop-port", "0", "--rate", "50", "--speed-ratio", "1.0"]
        results, deadline = [], time.monotonic() + 800.0
        person = PersonAtRun([*command, "--preview", "--hold-to-run"])
        try:
            with LearnerLife(learner):
                while person.process.poll() is None and not results and time.monotonic() < deadline:
                    results = learner.results(0.2)
        finally:
            person.close()
    assert results, person.text[-3000:]
    trajectory = results[0].trajectories[0]
    assert len(trajectory) == TASK.horizon
    assert trajectory.refused < TASK.horizon, "no arm has moved"
    assert person.asked.count("Enter to go on") >= TASK.horizon
    log = (tmp_path / run.name / "agent.log").read_text()
    assert "Ada acknowledged: the stop key" in log
