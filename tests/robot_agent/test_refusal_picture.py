"""The newest refused plan has a picture in the agent's folder, without anybody having asked for one."""

import logging

import cv2
import numpy as np
from agent_setup import TASK, ScriptedWorld
from motions import skill_motion
from recording_arms import HOME, TestBench

from taskschema.randomness import EpisodeKey
from taskschema.safety.limits import SafetyLimits
from taskschema_robot.agent.episode import EpisodeRunner
from taskschema_robot.agent.refusal_picture import RefusalPicture
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


def test_a_refused_step_leaves_a_picture_that_the_log_names(tmp_path, caplog):
    caplog.set_level(logging.INFO, "taskschema.robot")
    bench, now = TestBench(limits=SafetyLimits(period=0.02)), [0.0]
    picture = RefusalPicture(tmp_path / "refused.png", lambda: now[0])
    size = np.array(HEAVY_BAR.size)
    runner = EpisodeRunner(
        TASK, size, bench.gate, ScriptedWorld(), bench.clock, bench.limits, listeners=[picture]
    )
    _, record = runner.run(EpisodeKey(0, 0, 0, 0), Meeting())
    assert len(record.refusals) == TASK.horizon
    drawn = cv2.imread(str(tmp_path / "refused.png"))
    red = (drawn[..., 2] > 200) & (drawn[..., 1] < 50) & (drawn[..., 0] < 50)
    assert red.sum() > 40
    lines = [line for line in caplog.messages if line.startswith("Refused,")]
    assert lines[0].startswith(f"Refused, see {tmp_path / 'refused.png'}: top_grasp, top_grasp: ")
    assert all("no picture so soon" in line for line in lines[1:])
    assert [path.name for path in tmp_path.iterdir()] == ["refused.png"]


def test_another_is_drawn_after_a_while(tmp_path):
    now = [0.0]
    picture = RefusalPicture(tmp_path / "refused.png", lambda: now[0])
    motion = skill_motion(HOME, ("top_grasp", "top_grasp"), ([0.0, 0.0, 2.4], [0.0, 0.0, 2.4]))
    refusal, key = TestBench().gate.check(motion), EpisodeKey(0, 0, 0, 0)

    def refused(title: str) -> StepRecord:
        return StepRecord(key, 0, (title, title), {}, np.zeros(7), motion, 0.0, refusal=refusal)

    picture(refused("first"))
    first = (tmp_path / "refused.png").read_bytes()
    now[0] = 5.0
    picture(refused("second"))
    assert (tmp_path / "refused.png").read_bytes() == first
    now[0] = 11.0
    picture(refused("third"))
    assert (tmp_path / "refused.png").read_bytes() != first
