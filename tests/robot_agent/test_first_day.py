"""The first day's list, on a twin: what is good, what is not, and what is said of it."""

import re
import threading
import time
from functools import partial

import numpy as np
import pytest
from marker_scene import INTRINSICS, draw
from person_at_terminal import HOLD, PATIENT
from person_at_terminal import PersonAtTerminal as TypingPerson
from recording_arms import HOME, TestBench
from twin_setup import LockStep, RunningTwin
from typer.testing import CliRunner

from taskschema.config import RunConfig
from taskschema.errors import ConfigError
from taskschema.kinematics.rotation import vertical_turn
from taskschema.kinematics.sawyer import rethink_gripper, sawyer, sawyer_pair
from taskschema.safety.limits import SafetyLimits
from taskschema.skills.pairs import ARMS
from taskschema_robot.agent import first_day
from taskschema_robot.agent.first_day import FirstDay
from taskschema_robot.agent.first_day_person import PersonAtTerminal, TwinOnFirstDay
from taskschema_robot.agent.frame_trial import Offset
from taskschema_robot.agent.stop_trial import StopTrial
from taskschema_robot.agent.surroundings import look_for_run, look_through
from taskschema_robot.camera.camera import Frame
from taskschema_robot.cli.main import app
from taskschema_robot.errors import RobotError
from taskschema_robot.finding import Finding
from taskschema_robot.objects.marker import table_markers
from taskschema_robot.reward.poses import Pose
from taskschema_robot.safety.fault import FaultError
from taskschema_robot.safety.gate import SafetyGate
from taskschema_robot.twin.faults import FaultKind
from taskschema_robot.twin.twin import TwinOptions

LIMITS = SafetyLimits(speed_ratio=0.1)


class Helper:
    """Confirms everything; presses nothing."""

    def confirm(self, question: str) -> bool:
        return True

    def press_button(self, arm: int, *, pressed: bool) -> None:
        pass

    def press_stop_key(self, stop) -> None:
        pass

    def measure(self, question: str):
        return None


class Day:
    """A list with its lines; everything is confirmed."""

    def __init__(self, gate, clock, helper=None, looks=()) -> None:
        self.lines: list[str] = []
        self.day = FirstDay(gate, clock, LIMITS, helper or Helper(), self.lines.append, looks)

    def line(self, what: str) -> str:
        return next(line for line in self.lines if what in line)


@pytest.fixture
def twin():
    running = LockStep()
    yield running
    running.close()


def on_twin(twin: LockStep, helper=None) -> Day:
    gate = SafetyGate(twin.arms, twin.clock, LIMITS)
    return Day(gate, twin.clock, helper or TwinOnFirstDay(twin.client, twin.clock))


def test_the_list_on_a_twin_up_to_the_frame(twin, monkeypatch):
    """The frame has tests of its own below: on the twin it takes minutes."""
    monkeypatch.setattr(FirstDay, "_one_frame", lambda day: True)
    day = on_twin(twin)
    assert day.day.look(), day.lines
    assert day.line("left hand").endswith("0 N and 0.0 Nm at rest")
    assert day.day.move(), day.lines
    done = [line for line in day.lines if line.endswith(": done")]
    assert len(done) == 7
    words = re.search(
        r"at (.*) rad/s they ran on by left (.*) rad, right (.*) rad, and rested (.*) s after it",
        day.line("good  Press the stop key"),
    )
    speed, left, right, seconds = map(float, words.groups())
    assert 0.1 < speed <= 0.1 * sawyer().velocity[6] + 0.02
    assert 0.0 < min(left, right) <= max(left, right) < speed * seconds
    assert seconds < 0.2
    assert sum("emergency stop button" in line for line in done) == 2
    assert sum("Close and open both grippers" in line for line in done) == 1
    assert all(state.ready for state in (arm.state() for arm in twin.arms))
    assert all(arm.gripper_acknowledged for arm in twin.arms)


def test_a_button_that_nobody_presses_or_sees(twin, monkeypatch):
    monkeypatch.setattr(first_day, "BUTTON_SECONDS", 0.5)
    day = on_twin(twin, Helper())
    assert not day.day.move()
    assert day.lines[-1].startswith("MEND  Press the left robot's emergency stop button")
    assert "nobody pressed it" in day.lines[-1]


def test_a_stop_key_that_nobody_presses_or_that_stops_nothing():
    bench = TestBench()
    with pytest.raises(RobotError, match="nobody pressed it, or it stops nothing"):
        StopTrial(bench.gate, bench.clock, LIMITS).run(lambda stop: None)


def test_an_arm_that_does_not_come_to_rest():
    bench = TestBench()

    def press(stop) -> None:
        def stop_while_it_moves() -> None:
            bench.arms[1].changes["velocities"] = np.full(7, 0.3)
            stop("the stop key")

        bench.clock.after(1.0, stop_while_it_moves)

    trial = StopTrial(bench.gate, bench.clock, LIMITS)
    with pytest.raises(RobotError, match="does not rest 5 s after the stop"):
        trial.run(press)


def test_another_fault_is_not_taken_for_the_stop_key():
    bench = TestBench()
    trial = StopTrial(bench.gate, bench.clock, LIMITS)
    with pytest.raises(FaultError, match="the hold-to-run key"):
        trial.run(lambda stop: bench.clock.after(1.0, lambda: bench.gate.stop("the hold-to-run key")))


@pytest.mark.slow  # a held key must keep coming, on a machine with nothing else to do
@pytest.mark.timeout(300)
def test_the_list_at_a_terminal_with_the_key_held_and_the_stop_key_pressed():
    """The command itself: every motion waits for h, space stops the wrists, and the line says how far."""
    running = RunningTwin(TwinOptions(real_time=False))
    robots = running.twin.robots

    def press_as_soon_as_they_turn() -> None:
        while max(abs(robot.control.velocity[6]) for robot in robots) < 0.1:
            time.sleep(0.001)
        person.type(b" ")

    buttons = {
        f"{words} the {name} robot's emergency stop button now": partial(
            running.twin.inject, FaultKind.PRESS_EMERGENCY_STOP, arm, active=words == "Press"
        )
        for arm, name in enumerate(ARMS)
        for words in ("Press", "Release")
    }
    stop_key = partial(threading.Thread(target=press_as_soon_as_they_turn, daemon=True).start)
    answers = {"[y/n] ": "y\n", "not measured) ": "1 -2\n", "Press the space bar": stop_key, **buttons}
    command = [*PATIENT, "check", "--twin", running.control_url, "--move", "--stop-port", "0"]
    person = TypingPerson(command, answers)
    try:
        person.process.wait(240)
    finally:
        person.close()
        running.close()
    assert person.process.returncode == 0, person.text
    assert "they ran on by" in person.text
    assert person.text.count("x +1, y -2 mm") == 4
    assert person.asked.count(HOLD) >= 4  # grippers, both wrists, the stop


class Surveyor(Helper):
    """Measures what the arms' true bases make of where the hands are."""

    def __init__(self, bench: TestBench, off: tuple[float, float] = (0.0, 0.0), turn: float = 0.0) -> None:
        self.bench, self.heights = bench, []
        base = sawyer_pair()[0]
        rotation = vertical_turn(np.array([turn]))[0] @ base.base_rotation
        self.arms = (base.at(base.base_position + [*off, 0.0], rotation), sawyer_pair()[1])

    def measure(self, question: str) -> tuple[float, float]:
        arm, number = re.search(r"the (left|right) finger tips from marker (\d+)", question).groups()
        side = ARMS.index(arm)
        joints = self.bench.positions()[side : side + 1]
        position, rotation = self.arms[side].forward(joints)
        tip = position[0] + rethink_gripper().fingertip * rotation[0, :, 2]
        marker = next(marker for marker in table_markers() if marker.number == int(number))
        offset = tip - marker.position
        self.heights.append(float(offset[2]))
        return (1000 * offset[0], 1000 * offset[1])


def surveyed(**kwargs) -> tuple[bool, list[str], list[float]]:
    bench = TestBench()
    helper = Surveyor(bench, **kwargs)
    day = Day(bench.gate, bench.clock, helper)
    good = day.day._one_frame()
    np.testing.assert_allclose(bench.positions(), HOME, atol=1e-3)
    return good, day.lines, helper.heights


def test_hands_go_to_10_cm_above_two_markers_each():
    good, lines, heights = surveyed()
    assert good, lines
    assert lines[0] == "good  left hand above markers: 40: x +0, y +0 mm, 43: x +0, y +0 mm"
    assert "42: x +0, y +0 mm, 45" in lines[1]
    np.testing.assert_allclose(heights, 0.1, atol=1e-3)


def test_a_base_that_stands_2_cm_off_is_found():
    good, lines, _ = surveyed(off=(0.02, -0.004))
    assert not good
    assert lines[0].startswith("MEND  left hand above markers: 40: x +20, y -4 mm, 43: x +20, y -4 mm")
    assert "+20, -4 mm off: move it back by that" in lines[0]
    assert lines[1].startswith("good  right hand")


def test_a_base_that_is_turned_is_found():
    good, lines, _ = surveyed(turn=np.deg2rad(1.5))
    assert not good
    assert "the two differ" in lines[0]


def test_what_nobody_measures_is_said_so():
    bench = TestBench()
    day = Day(bench.gate, bench.clock)
    assert day.day._one_frame()
    assert [line.startswith("left  ") and "nobody measured it" in line for line in day.lines] == [True, True]


@pytest.mark.parametrize(("x", "good"), [(5.0, True), (-5.1, False), (np.nan, False)])
def test_5_mm_are_borne(x, good):
    marker = table_markers()[0]
    assert Offset(marker, x, 0.0).good is good
    assert Offset(marker, 0.0, x).good is good


def test_a_measurement_is_asked_for_until_it_is_two_numbers():
    lines = iter(["3", "3 up", "nan 1", "3 -1.5", ""])
    person = PersonAtTerminal(lambda question: next(lines))
    assert person.measure("How far?") == (3.0, -1.5)
    assert person.measure("How far?") is None


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_the_twins_hands_are_above_its_markers(twin):
    """The world's own sites, which share no code with the kinematics that planned the way."""
    day = on_twin(twin)
    world = twin.running.twin.world
    seen: list[float] = []

    def look(question: str) -> None:
        arm, number = re.search(r"the (left|right) finger tips from marker (\d+)", question).groups()
        site = world.arms[ARMS.index(arm)].grip
        tip = world.data.site_xpos[site] + rethink_gripper().fingertip * world.data.site_xmat[site][2::3]
        marker = next(marker for marker in table_markers() if marker.number == int(number))
        seen.extend((tip - marker.position).tolist())

    day.day._person.measure = look
    assert day.day._one_frame(), day.lines
    np.testing.assert_allclose(np.reshape(seen, (4, 3)), [[0.0, 0.0, 0.1]] * 4, atol=0.004)


def test_no_arm_moves_without_a_terminal_to_stop_it_from(twin):
    result = CliRunner().invoke(app, ["check", "--twin", twin.client.url, "--move"])
    assert isinstance(result.exception, ConfigError)
    assert "at a terminal" in str(result.exception)


def test_a_gripper_that_does_not_acknowledge(twin):
    twin.client.inject(FaultKind.LOSE_ACKNOWLEDGEMENT, 1)
    day = on_twin(twin)
    assert not day.day.move()
    assert day.lines[-1].startswith("MEND  Close and open both grippers")
    assert "right gripper" in day.lines[-1]


@pytest.mark.parametrize("wrench", [[0, 25.0, 0, 0, 0, 0], [0, 0, 0, 5.0, 0, 0]])
def test_a_hand_that_feels_something_at_rest(wrench):
    bench = TestBench()
    bench.arms[1].changes["wrench"] = np.array(wrench)
    day = Day(bench.gate, bench.clock)
    assert not day.day.look()
    assert day.line("right hand").startswith("MEND")
    assert day.line("left hand").startswith("good")


def test_what_is_looked_at_beside_the_arms_counts():
    bench = TestBench()
    good = Day(bench.gate, bench.clock, looks=[lambda: [Finding("camera", True, "fine")]])
    assert good.day.look()
    bad = Day(bench.gate, bench.clock, looks=[lambda: [Finding("camera", False, "dark")]])
    assert not bad.day.look()
    assert bad.lines[-1] == "MEND  camera: dark"


class Camera:
    """Takes the same picture again and again, under new numbers or not."""

    def __init__(self, image: np.ndarray, *, counts: bool = True) -> None:
        self.image, self.counts, self.number = image, counts, 0

    def latest(self) -> Frame:
        self.number += self.counts
        return Frame(0.0, self.number, self.image)


def test_the_cameras_picture_and_markers():
    clock = TestBench().clock
    table = Pose(np.zeros(3), np.eye(3))
    picture = draw([(marker, table) for marker in table_markers()])
    found = {item.what: item for item in look_through(Camera(picture), INTRINSICS, clock)}
    assert found["camera picture"].words == "1920 x 1080 pixels"
    assert all(item.good for item in found.values())
    dark = {item.what: item for item in look_through(Camera(np.zeros_like(picture)), INTRINSICS, clock)}
    assert dark["camera picture"].good
    assert not dark["table markers"].good
    (still,) = look_through(Camera(picture, counts=False), INTRINSICS, clock)
    assert not still.good
    assert "1 new ones in 5 s" in still.words


def test_redis_and_the_run(run):
    place, found = look_for_run(run.url, run.name)
    assert place.good
    assert not found.good  # four episodes a slot: not for a robot
    assert "--agent robot" in found.words
    robots = RunConfig(task="lateral-lifting", slots=3, episodes_per_slot=1)
    run.records.register_run("for-robots", robots)
    _, found = look_for_run(run.url, "for-robots")
    assert found.good
    assert found.words.startswith("lateral-lifting, starting")
    run.records.delete_run("for-robots")
    _, found = look_for_run(run.url, "no-such-run")
    assert not found.good
    (away,) = look_for_run("redis://127.0.0.1:9", run.name)
    assert not away.good
    assert "does not answer" in away.words
