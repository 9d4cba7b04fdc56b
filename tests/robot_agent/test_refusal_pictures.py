"""Refused plans have pictures in the agent's folder, without anybody having asked for them."""

import logging

import cv2
import numpy as np
from agent_setup import TASK, ScriptedWorld
from motions import skill_motion
from recording_arms import HOME, TestBench

from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.refusal_pictures import KEPT, RefusalPictures
from taskschema_robot.agent.step_log import StepRecord
from taskschema_robot.objects.catalogue import HEAVY_BAR


class Meeting:
    """A policy whose hands would meet over the middle of the bar."""

    def act(self, observations, step, streams):
        pairs = TASK.pairs
        index = pairs.pairs.index(("top_grasp", "top_grasp"))
        arguments = np.zeros((1, pairs.argument_count))

        class Actions:
            pass

        actions = Actions()
        actions.pairs, actions.arguments, actions.raw = np.array([index]), arguments, arguments
        return actions


def test_refused_steps_leave_pictures_that_the_log_names(tmp_path, caplog):
    caplog.set_level(logging.INFO, "taskschema.robot")
    bench = TestBench(limits=SafetyLimits(period=0.02))
    size = np.array(HEAVY_BAR.size)
    for _ in range(2):  # two sessions in one folder, the first of which was killed
        pictures = RefusalPictures(tmp_path)
        runner = EpisodeRunner(
            TASK, size, bench.gate, ScriptedWorld(), bench.clock, bench.limits, listeners=[pictures]
        )
        _, record = runner.run(EpisodeKey(0, 3, 7, 0), Meeting())
    steps = range(TASK.horizon)
    assert len(record.refusals) == len(steps)
    names = [f"000003-000007-0-{step}" for step in steps]
    drawn = [tmp_path / f"{name}.png" for name in names] + [tmp_path / f"{name}-2.png" for name in names]
    assert sorted(tmp_path.iterdir()) == sorted(drawn)
    picture = cv2.imread(str(drawn[0]))
    red = (picture[..., 2] > 200) & (picture[..., 1] < 50) & (picture[..., 0] < 50)
    assert red.sum() > 40
    lines = [line for line in caplog.messages if line.startswith("Refused,")]
    for line, path in zip(lines, drawn, strict=True):
        assert line.startswith(f"Refused, see {path}: top_grasp, top_grasp: ")


def test_the_last_hundred_are_kept_and_none_so_soon_after_another(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "taskschema_robot.agent.refusal_pictures.draw_motion", lambda path, *unused: path.touch()
    )
    now = [0.0]
    pictures = RefusalPictures(tmp_path, 10.0, lambda: now[0])
    motion = skill_motion(HOME, ("top_grasp", "top_grasp"), ([0.0, 0.0, 2.4], [0.0, 0.0, 2.4]))
    refusal, key = TestBench().gate.check(motion), EpisodeKey(0, 0, 0, 0)
    for step in range(2 * KEPT + 10):
        pictures(StepRecord(key, step, ("lift", "lift"), {}, np.zeros(7), motion, 0.0, refusal=refusal))
        pictures(StepRecord(key, step, ("lift", "lift"), {}, np.zeros(7), motion, 0.0))  # it was made
        now[0] += 5.0
    kept = sorted(int(path.stem.rpartition("-")[2]) for path in tmp_path.iterdir())
    assert kept == list(range(10, 2 * KEPT + 10, 2))
