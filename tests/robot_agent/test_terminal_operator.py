"""The operator's flow at a terminal: progress, pause, undo, resets, faults."""

import csv
import dataclasses
import logging
from collections import deque

import cv2
import numpy as np
import pytest
from rich.console import Console
from twin_setup import LockStep

from taskschema_robot.agent.episode import EpisodeRecord
from taskschema_robot.agent.progress import Progress
from taskschema_robot.agent.reset_picture import draw_reset
from taskschema_robot.agent.terminal_operator import TerminalOperator
from taskschema_robot.agent.world import SessionEndedError
from taskschema_robot.cli.person import Person, unattended_person
from taskschema_robot.objects.catalogue import get_object
from taskschema_robot.reward.judge import Judgement, Outcome
from taskschema_robot.safety.fault import Fault, FaultKind


class Terminal:
    """An operator with keys and lines in a row."""

    def __init__(self, tmp_path, keys=(), lines=()) -> None:
        self.keys, self.lines = deque(keys), deque(lines)
        self.questions: list[str] = []
        self.quits: list[bool] = []
        self.console = Console(record=True, width=120, highlight=False)
        self.operator = TerminalOperator(
            self.console, self.take, self.ask, tmp_path, lambda: self.quits.append(True), undo_seconds=0.2
        )

    def take(self):
        return self.keys.popleft() if self.keys else None

    def ask(self, question, ended=None):
        self.questions.append(question)
        return self.lines.popleft()

    @property
    def text(self) -> str:
        return self.console.export_text(clear=False)


RECORD = EpisodeRecord(
    [("top_grasp", "top_grasp"), ("lift", "lift")], [], 24.0, "success", "the goal is reached"
)


def test_it_says_what_happens_next_and_how_far_it_is(tmp_path):
    progress = Progress(tmp_path / "episodes.csv")
    for number in range(100):
        progress.add(0, number, 0, number % 4 > 0, RECORD)
    progress.add_dropped(0, 100, 0, RECORD, "a fault")
    terminal = Terminal(tmp_path)
    terminal.operator.begin(progress, "round 0, slot 100")
    assert "round 0, slot 100" in terminal.text
    assert "75% of the last 100" in terminal.text
    assert "100 episodes; dropped tries: 1" in terminal.text
    assert "404 skills, 0.7 hours on the robot's clock" in terminal.text
    assert "not safety rated" in terminal.text


def test_progress_goes_on_after_a_restart(tmp_path):
    first = Progress(tmp_path / "episodes.csv")
    for number in range(5):
        first.add(0, number, 0, number > 1, RECORD)
    first.add_dropped(0, 5, 1, RECORD, 'a "fault", twice\nsaid')
    again = Progress(tmp_path / "episodes.csv")
    assert (again.episodes, again.dropped, again.skills) == (5, 1, 24)
    assert again.success == pytest.approx(0.6)
    assert again.hours == pytest.approx(6 * 24 / 3600)


def test_a_file_of_an_earlier_version_gets_the_columns_that_it_lacks(tmp_path):
    path = tmp_path / "episodes.csv"
    Progress(path).add(0, 0, 0, True, RECORD)
    path.write_text("\n".join(line.rpartition(",")[0] for line in path.read_text().splitlines()) + "\n")
    again = Progress(path)
    again.add(0, 1, 0, True, dataclasses.replace(RECORD, evidence="end-success.png"))
    with path.open(newline="") as file:
        assert [row["evidence"] for row in csv.DictReader(file)] == ["", "end-success.png"]
    assert again.episodes == 2


def test_hours_left_follow_from_growth(tmp_path):
    progress = Progress(tmp_path / "episodes.csv")
    assert progress.hours_left() is None
    for number in range(100):  # 20 % in the first half, 60 % in the second: 0.4 in 50 episodes
        progress.add(0, number, 0, number % 5 < (1 if number < 50 else 3), RECORD)
    # 0.9 - 0.4 = 0.5 more at 0.4 in 50 episodes: 62.5 episodes of 24 s.
    assert progress.hours_left() == pytest.approx(62.5 * 24 / 3600)


@pytest.fixture
def log(caplog):
    """What stands in the agent's log."""
    caplog.set_level(logging.INFO, "taskschema.robot")
    return caplog


def test_pause_waits_for_a_person(tmp_path, log):
    terminal = Terminal(tmp_path, keys=["p"], lines=[""])
    terminal.operator.begin(Progress(tmp_path / "episodes.csv"), "next")
    assert "Paused" in terminal.questions[0]
    assert log.messages == ["A person paused", "A person goes on"]


def test_quit(tmp_path):
    terminal = Terminal(tmp_path, keys=["q"])
    with pytest.raises(SessionEndedError):
        terminal.operator.begin(Progress(tmp_path / "episodes.csv"), "next")
    assert terminal.quits


def test_quit_at_the_reset_prompt(tmp_path):
    terminal = Terminal(tmp_path, lines=["q"])
    with pytest.raises(SessionEndedError):
        terminal.operator.ask_reset(
            get_object("heavy-bar"), np.array([0.0, 0.0, 0.02, 1.0, 0.0, 0.0, 0.0]), ""
        )
    assert terminal.quits


@pytest.mark.parametrize(
    ("keys", "lines", "expected"),
    [((), (), True), ("u", ("y",), False), ("u", ("n",), True), ("u", ("d",), None), ("d", (), None)],
)
def test_an_outcome_can_be_undone(tmp_path, keys, lines, expected):
    terminal = Terminal(tmp_path, keys, lines)
    assert terminal.operator.review(RECORD) is expected
    assert "success" in terminal.text


def test_a_fault_needs_a_name(tmp_path):
    terminal = Terminal(tmp_path, lines=["", "  ", "Ada"])
    fault = Fault(FaultKind.WRENCH, "left arm: a force of 90 N", 0.0)
    assert terminal.operator.acknowledge(fault) == "Ada"
    assert "90 N" in terminal.text
    assert "does not count" in terminal.text


def test_hands_open_once_a_person_has_taken_what_they_hold(tmp_path):
    terminal = Terminal(tmp_path, lines=[""])
    terminal.operator.release("the held object would be pressed 2.0 cm too deep")
    assert "too deep" in terminal.text
    assert "TAKE THE OBJECT" in terminal.text
    assert terminal.questions == ["Press Enter when you hold it: "]


def test_a_reset_is_asked_for_with_a_picture(tmp_path):
    item = get_object("heavy-bar")
    terminal = Terminal(tmp_path, lines=[""])
    wanted = np.array([0.04, -0.03, 0.0225, np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8)])
    terminal.operator.ask_reset(item, wanted, "it is 9 cm from where it should be")
    assert "x +4 cm, y -3 cm" in terminal.text
    assert "9 cm" in terminal.text
    for step in item.reset:
        assert step[:20] in terminal.text
    assert cv2.imread(str(tmp_path / "reset.png")) is not None


def test_the_reset_picture_shows_the_place(tmp_path):
    item = get_object("plastic-box")
    upright = np.array([0.0, 0.0, 0.06, 1.0, 0.0, 0.0, 0.0])
    pictures = []
    for number, x in enumerate((-0.05, 0.05)):
        draw_reset(tmp_path / f"{number}.png", item, upright + np.array([x, 0, 0, 0, 0, 0, 0]))
        picture = cv2.imread(str(tmp_path / f"{number}.png")).astype(int)
        blue = picture[..., 0] - picture[..., 2] > 50
        pictures.append(np.nonzero(blue)[1].mean())
    assert pictures[1] - pictures[0] > 20


@pytest.mark.parametrize(("line", "expected"), [("y", True), ("n", False), ("", None)])
def test_an_unknown_outcome_is_asked_about(tmp_path, log, line, expected):
    terminal = Terminal(tmp_path, lines=[line])
    judgement = Judgement(Outcome.UNKNOWN, "the lid's marker is hidden")
    assert terminal.operator.ask_outcome(judgement) is expected
    assert "hidden" in terminal.text
    word = {True: "a success", False: "a failure", None: "not known"}[expected]
    assert log.messages[-1] == (
        f"The outcome is unknown (the lid's marker is hidden); by a person's word it is {word}"
    )


def test_a_twin_puts_its_object_back_and_the_person_says_only_what_nobody_sees(tmp_path):
    terminal = Terminal(tmp_path, lines=["y"])
    hidden = Judgement(Outcome.UNKNOWN, "the lid's marker is hidden")
    twin, item = LockStep(get_object("heavy-bar")), get_object("heavy-bar")
    try:
        resets = Person(terminal.operator, terminal.operator).resets(twin.client)
        wanted = np.array([0.05, -0.03, 0.5 * item.size[2], 1.0, 0.0, 0.0, 0.0])
        resets.ask_reset(item, wanted, "")
        assert terminal.questions == []
        np.testing.assert_allclose(twin.client.object_pose()[:2], wanted[:2], atol=1e-3)
        assert resets.ask_outcome(hidden) is True
        assert unattended_person().resets(twin.client).ask_outcome(hidden) is None
    finally:
        twin.close()
    assert Person(terminal.operator, terminal.operator).resets(None) is terminal.operator
